// Polygons as a row of bytes, from one process to another; internal.
#pragma once

#include <cstddef>

#include "sdf/io/child_process.h"
#include "sdf/io/polygons.h"

namespace bilayer::detail {

/// Sends polygons, or the text of an error instead of them.
void sendPolygons(const ChildProcess::Send& send, const Polygons& polygons);
void sendError(const ChildProcess::Send& send, const std::string& text);

/// Receives what was sent, and takes nothing for granted: throws ChildFailure if the counts exceed `byteLimit`, do not
/// belong together, or a corner is no point; std::runtime_error with the text of an error that was sent.
Polygons receivePolygons(ChildProcess& child, std::size_t byteLimit);

}  // namespace bilayer::detail
