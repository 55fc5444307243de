// SPDX-License-Identifier: Apache-2.0
// Serialises polygons for transfer from one process to another; internal.
// Tested by tests/sdf/child_process.cpp.
#pragma once

#include <cstddef>

#include "sdf/io/child_process.h"
#include "sdf/io/polygon/polygons.h"

namespace bilayer::detail {

/// Sends polygons; or instead an error text, or that memory is exhausted.
void sendPolygons(const ChildProcess::Send& send, const Polygons& polygons);
void sendError(const ChildProcess::Send& send, const std::string& text);
void sendOutOfMemory(const ChildProcess::Send& send);

/// Receives polygons without trusting the data. Throws ChildFailure if the counts exceed `byteLimit` or are
/// inconsistent, or if a corner refers to no point. Throws std::runtime_error with the error text if one was sent,
/// and std::bad_alloc if memory was exhausted. The error text and the notes are one line each (see oneLine()).
Polygons receivePolygons(const ChildProcess::Receive& receive, std::size_t byteLimit);

}  // namespace bilayer::detail
