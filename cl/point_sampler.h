// SPDX-License-Identifier: Apache-2.0
// Samples the points of bodies in the fields of other bodies on an OpenCL device, in one batch per step; kernel in
// point_sampler.cl.
// Tested by tests/bullet/sampled_pairs.cpp.
#pragma once

#include <functional>

#include <bilayer/cl/device.h>
#include <bilayer/cl/filler.h>
#include <bilayer/collider/contact.h>

namespace bilayer {

/// A point sampler on a device, with its times.
struct OpenclPointSampler : PointSampler {
    std::function<OpenclTimes()> times;  ///< of all batches so far by this sampler and its copies
};

/// A point sampler on a device. Bodies are uploaded on first use, and stay. If the memory is full, all bodies are
/// released except those of the current batch. Queries are uploaded, and their results downloaded; only one batch runs
/// at a time.
///
/// Throws DeviceError, here and when it samples: for errors of the device, for a device without double precision, and
/// if the memory is too small for the bodies of one batch. The text then states how many MiB are needed.
OpenclPointSampler openclPointSampler(const Device& device, const OpenclOptions& options = {});

}  // namespace bilayer
