// Stage: bindings. Long C++ calls that leave Python responsive: the work runs on a thread of its
// own without the GIL, while the calling thread looks for signals and reports progress.
#pragma once

#include <Python.h>
#include <nanobind/nanobind.h>
#include <nanobind/stl/function.h>
#include <nanobind/stl/optional.h>

#include <chrono>
#include <cstdint>
#include <functional>
#include <future>
#include <optional>

#include "limitray/scene.h"

namespace limitray::bindings {

namespace nb = nanobind;

/// Called from the waiting thread, with the GIL, with the number of rays done so far.
using ProgressCallback = std::optional<std::function<void(std::uint64_t)>>;

/// How often the waiting thread looks for Ctrl-C: well below the promised half second.
inline constexpr std::chrono::milliseconds signal_interval{50};

/// Returns `work(progress)`. Call with the GIL held. A signal handler or a callback that raises
/// cancels the work, waits for its end and raises; exceptions of the work are passed on.
template <class Work>
auto run_interruptibly(Work&& work, const ProgressCallback& callback = std::nullopt) {
  Progress progress;
  auto result = std::async(std::launch::async, [&] { return work(progress); });

  const auto finished_within = [&](std::chrono::milliseconds time) {
    nb::gil_scoped_release release;
    return result.wait_for(time) == std::future_status::ready;
  };
  try {
    while (!finished_within(signal_interval)) {
      if (PyErr_CheckSignals() != 0) throw nb::python_error();
      if (callback) (*callback)(progress.done.load());
    }
  } catch (...) {
    progress.cancel = true;
    nb::gil_scoped_release release;
    result.wait();
    throw;
  }
  if (PyErr_CheckSignals() != 0) throw nb::python_error();
  return result.get();
}

}  // namespace limitray::bindings
