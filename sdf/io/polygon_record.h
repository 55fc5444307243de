// SPDX-License-Identifier: Apache-2.0
// Serialises polygons for transfer from one process to another; internal.
// Tested by tests/sdf/child_process.cpp.
#pragma once

#include <cstddef>

#include "sdf/io/child_process.h"
#include "sdf/io/polygons.h"

namespace bilayer::detail {

/// Sends polygons, or an error text instead.
void sendPolygons(const ChildProcess::Send& send, const Polygons& polygons);
void sendError(const ChildProcess::Send& send, const std::string& text);

/// Receives polygons without trusting the data. Throws ChildFailure if the counts exceed `byteLimit` or are
/// inconsistent, or if a corner refers to no point. Throws std::runtime_error with the error text if one was sent.
Polygons receivePolygons(ChildProcess& child, std::size_t byteLimit);

}  // namespace bilayer::detail
