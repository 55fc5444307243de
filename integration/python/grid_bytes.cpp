// SPDX-License-Identifier: Apache-2.0
#include "integration/python/grid_bytes.h"

#include <openvdb/io/Stream.h>

#include <istream>
#include <sstream>
#include <string>

#include "integration/python/without_gil.h"
#include "sdf/base/openvdb.h"

namespace bilayer::python {

py::bytes bytesOf(const openvdb::GridCPtrVec& grids) {
    std::string bytes;
    {
        const WithoutGil release;
        openvdb::initialize();
        std::ostringstream stream(std::ios::binary);
        openvdb::io::Stream(stream).write(grids);
        bytes = std::move(stream).str();
    }
    return bytes;
}

openvdb::GridPtrVec gridsOf(const py::bytes& bytes) {
    const auto view = bytes.cast<std::string>();
    const WithoutGil release;
    openvdb::initialize();
    std::istringstream stream(view, std::ios::binary);
    return *openvdb::io::Stream(stream, /*delayLoad=*/false).getGrids();
}

}  // namespace bilayer::python
