// limitray_bench: limitray against Embree on one model. docs/performance.md says what is measured.
#include <exception>
#include <fstream>
#include <iostream>
#include <stdexcept>

#include "report.h"

namespace {

using namespace limitray::bench;

std::string joined(const std::vector<std::string>& arguments) {
  std::string line = "limitray_bench";
  for (const std::string& a : arguments) line += ' ' + a;
  return line;
}

void run(const Options& options, const std::string& command) {
  std::ofstream file;
  if (!options.json.empty() && options.json != "-") {
    file.open(options.json);
    if (!file) throw std::runtime_error(options.json + ": cannot be written");
  }
  const Comparison c = compare(options, [](const std::string& line) {
    std::cerr << "limitray_bench: " << line << std::endl;
  });
  if (options.json == "-")
    write_json(std::cout, c, options, command);
  else
    write_table(std::cout, c);
  if (file.is_open()) write_json(file, c, options, command);
}

}  // namespace

int main(int argc, char** argv) {
  const std::vector<std::string> arguments(argv + 1, argv + argc);
  try {
    const Options options = parse_options(arguments);
    if (options.help)
      std::cout << usage;
    else
      run(options, joined(arguments));
    return 0;
  } catch (const std::invalid_argument& error) {
    std::cerr << "limitray_bench: " << error.what() << '\n';
    return 2;
  } catch (const std::exception& error) {
    std::cerr << "limitray_bench: " << error.what() << '\n';
    return 1;
  }
}
