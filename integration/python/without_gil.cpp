// SPDX-License-Identifier: Apache-2.0
#include "integration/python/without_gil.h"

#include <cxxabi.h>
#include <unistd.h>

namespace bilayer::python {

void waitForExit() {
    for (;;) ::pause();
}

WithoutGil::~WithoutGil() {
    try {
        PyEval_RestoreThread(state_);
    } catch (abi::__forced_unwind&) {
        waitForExit();
    }
}

}  // namespace bilayer::python
