// What a comparison looks like: JSON for machines, a plain table for people.
#pragma once

#include <ostream>

#include "comparison.h"

namespace limitray::bench {

/// `command` is the command line as it was given.
void write_json(std::ostream& out, const Comparison& c, const Options& o,
                const std::string& command);
void write_table(std::ostream& out, const Comparison& c);

}  // namespace limitray::bench
