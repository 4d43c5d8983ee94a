// Time as the comparison takes it.
#pragma once

#include <algorithm>
#include <chrono>
#include <ctime>
#include <vector>

namespace limitray::bench {

/// Wall-clock seconds, and the processor's on all threads of this process, which do not count the
/// neighbours of a shared machine.
struct Seconds {
  double wall = 0, processor = 0;
};

/// Runs from when it is made.
class Stopwatch {
 public:
  Seconds read() const {
    const std::chrono::duration<double> wall = std::chrono::steady_clock::now() - start_;
    return {wall.count(), double(std::clock() - processor_) / CLOCKS_PER_SEC};
  }

 private:
  std::clock_t processor_ = std::clock();
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

/// Median of each member; at least one value.
inline Seconds median(const std::vector<Seconds>& times) {
  const auto middle = [&](double Seconds::*member) {
    std::vector<double> values;
    for (const Seconds& s : times) values.push_back(s.*member);
    std::sort(values.begin(), values.end());
    const std::size_t n = values.size();
    return 0.5 * (values[(n - 1) / 2] + values[n / 2]);
  };
  return {middle(&Seconds::wall), middle(&Seconds::processor)};
}

}  // namespace limitray::bench
