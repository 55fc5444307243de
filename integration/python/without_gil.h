// SPDX-License-Identifier: Apache-2.0
// What threads of Python do without its global interpreter lock (GIL).
// Tested by tests/python/test_lifetimes.py.
#pragma once

#include <pybind11/pybind11.h>

namespace bilayer::python {

/// Waits until the process ends. Python 3.13 and earlier ends a thread that takes the GIL while Python exits, by
/// unwinding its stack; C++ ends the whole process where that meets a destructor. Call this from a handler of
/// abi::__forced_unwind.
[[noreturn]] void waitForExit();

/// Releases the GIL for its lifetime.
class WithoutGil {
  public:
    WithoutGil() : state_(PyEval_SaveThread()) {}
    ~WithoutGil();
    WithoutGil(const WithoutGil&) = delete;
    WithoutGil& operator=(const WithoutGil&) = delete;

  private:
    PyThreadState* state_;
};

}  // namespace bilayer::python
