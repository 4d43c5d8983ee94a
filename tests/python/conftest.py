"""What all tests share."""

import signal

# A shell that starts this in the background has Ctrl-C ignored, and so would have the programs that
# tests start and interrupt: they would never end.
signal.signal(signal.SIGINT, signal.default_int_handler)
