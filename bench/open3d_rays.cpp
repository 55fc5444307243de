// SPDX-License-Identifier: Apache-2.0
// Preloaded by the benchmark `python`: sets the masks of Open3D's rays. Open3D 0.16 leaves them zero, which Embree
// takes as "no geometry" where it is built with ray masks, as Debian's is. All rays would miss, and all points be
// outside.
#include <dlfcn.h>
#include <embree3/rtcore.h>

#include <cstddef>

extern "C" void rtcIntersect1M(RTCScene scene, RTCIntersectContext* context, RTCRayHit* rays, unsigned int count,
                               std::size_t stride) {
    using Function = decltype(&rtcIntersect1M);
    // the module of Python has its library to itself, where RTLD_NEXT finds nothing
    static const auto original = Function(dlsym(dlopen("libembree3.so.3", RTLD_LAZY), "rtcIntersect1M"));
    for (unsigned int i = 0; i < count; ++i)
        reinterpret_cast<RTCRayHit*>(reinterpret_cast<std::byte*>(rays) + i * stride)->ray.mask = ~0u;
    original(scene, context, rays, count, stride);
}
