"""Sums up the results that scripts/test left in a folder; exits with 1 unless all passed."""

import sys
from pathlib import Path
from xml.etree import ElementTree


def main(folder: Path) -> int:
    """Prints each stage's outcome and each failed test, then the numbers of all tests."""
    passed = failed = skipped = 0
    for line in (folder / "stages").read_text().splitlines():
        stage, outcome = line.rsplit(" ", 1)
        print(f"{outcome:>7}  {stage}")
        passed += outcome == "passed"
        failed += outcome == "failed"
    for report in sorted(folder.glob("*.xml")):
        for case in ElementTree.parse(report).getroot().iter("testcase"):
            if case.find("failure") is not None or case.find("error") is not None:
                failed += 1
                print(f" failed  {report.stem}: {case.get('name')}")
            elif case.find("skipped") is not None:
                skipped += 1
            else:
                passed += 1
    print(f"limitray: {passed} passed, {failed} failed, {skipped} skipped")
    return 1 if failed or not passed else 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
