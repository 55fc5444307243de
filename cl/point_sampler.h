// The points of bodies in the fields of others on an OpenCL device, all of a step in one batch; kernel in
// point_sampler.cl.
#pragma once

#include <bilayer/cl/device.h>
#include <bilayer/cl/filler.h>
#include <bilayer/collider/contact.h>

namespace bilayer {

/// Samples on a device. Bodies are uploaded when they are first asked for, and stay; where the memory is full, all go
/// but those that are asked for. Queries go up and what they find comes down; no more than one batch is under way.
/// @param options  `times` receives what each batch took
/// Throws DeviceError, here and when it samples: for the device's own trouble, for one that cannot compute in double
/// precision, and where the memory is too small for the bodies of one batch; the text then says how many MiB are
/// needed.
PointSampler openclPointSampler(const Device& device, const OpenclOptions& options = {});

}  // namespace bilayer
