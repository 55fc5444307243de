// SPDX-License-Identifier: Apache-2.0
#include "bench/embree.h"

#include <embree3/rtcore.h>

#include <algorithm>
#include <array>
#include <glm/geometric.hpp>
#include <stdexcept>

#include "sdf/base/openvdb.h"

namespace bilayer::bench {
namespace {

using Corners = std::array<glm::vec3, 3>;

// C. Ericson, "Real-Time Collision Detection" (2005), 5.1.5: by the Voronoi regions of the triangle's features.
glm::vec3 closestOn(const Corners& t, const glm::vec3& point) {
    const glm::vec3 ab = t[1] - t[0], ac = t[2] - t[0], fromA = point - t[0];
    const float d1 = glm::dot(ab, fromA), d2 = glm::dot(ac, fromA);
    if (d1 <= 0 && d2 <= 0) return t[0];
    const glm::vec3 fromB = point - t[1];
    const float d3 = glm::dot(ab, fromB), d4 = glm::dot(ac, fromB);
    if (d3 >= 0 && d4 <= d3) return t[1];
    const float c = d1 * d4 - d3 * d2;
    if (c <= 0 && d1 >= 0 && d3 <= 0) return t[0] + d1 / (d1 - d3) * ab;
    const glm::vec3 fromC = point - t[2];
    const float d5 = glm::dot(ab, fromC), d6 = glm::dot(ac, fromC);
    if (d6 >= 0 && d5 <= d6) return t[2];
    const float b = d5 * d2 - d1 * d6;
    if (b <= 0 && d2 >= 0 && d6 <= 0) return t[0] + d2 / (d2 - d6) * ac;
    const float a = d3 * d6 - d5 * d4;
    if (a <= 0 && d4 >= d3 && d5 >= d6) return t[1] + (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (t[2] - t[1]);
    const float scale = 1 / (a + b + c);
    return t[0] + b * scale * ab + c * scale * ac;
}

// State of a closest-point query.
struct Search {
    const Corners* triangles;
    ClosestPoint* best;
};

bool visit(RTCPointQueryFunctionArguments* arguments) {
    const Search& search = *static_cast<const Search*>(arguments->userPtr);
    RTCPointQuery& query = *arguments->query;
    const glm::vec3 point(query.x, query.y, query.z);
    const glm::vec3 position = closestOn(search.triangles[arguments->primID], point);
    const float distance = glm::distance(position, point);
    if (distance >= query.radius) return false;
    query.radius = distance;
    search.best->distance = distance;
    search.best->position = position;
    search.best->triangle = arguments->primID;
    search.best->found = true;
    return true;
}

}  // namespace

struct Embree::Scene {
    RTCDevice device = rtcNewDevice(nullptr);
    RTCScene scene = rtcNewScene(device);
    std::vector<Corners> triangles;  // both are passed to the callback

    Scene(const Mesh& mesh, bool robust) {
        for (const glm::uvec3& t : mesh.triangles)
            triangles.push_back({mesh.points[t.x], mesh.points[t.y], mesh.points[t.z]});
        rtcSetSceneFlags(scene, robust ? RTC_SCENE_FLAG_ROBUST : RTC_SCENE_FLAG_NONE);
        rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_HIGH);
        const RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
        void* const points = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                                     sizeof(glm::vec3), mesh.points.size());
        void* const corners = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                                      sizeof(glm::uvec3), mesh.triangles.size());
        if (!points || !corners) throw std::runtime_error("Embree has no memory for the mesh");
        std::copy(mesh.points.begin(), mesh.points.end(), static_cast<glm::vec3*>(points));
        std::copy(mesh.triangles.begin(), mesh.triangles.end(), static_cast<glm::uvec3*>(corners));
        rtcCommitGeometry(geometry);
        rtcAttachGeometry(scene, geometry);
        rtcReleaseGeometry(geometry);
        rtcCommitScene(scene);
        if (const RTCError error = rtcGetDeviceError(device))
            throw std::runtime_error("Embree fails with error " + std::to_string(int(error)));
    }
    Scene(const Scene&) = delete;
    Scene& operator=(const Scene&) = delete;
    ~Scene() {
        rtcReleaseScene(scene);
        rtcReleaseDevice(device);
    }
};

Embree::Embree(const Mesh& mesh, bool robust) : scene_(std::make_shared<const Scene>(mesh, robust)) {}

Closest Embree::closest(const std::string& name, float radius) const {
    return {name, [radius, scene = scene_](std::span<const glm::vec3> points, std::span<ClosestPoint> answers) {
                RTCPointQueryContext context;
                rtcInitPointQueryContext(&context);
                for (std::size_t i = 0; i < points.size(); ++i) {
                    answers[i] = {};
                    Search search{scene->triangles.data(), &answers[i]};
                    RTCPointQuery query{points[i].x, points[i].y, points[i].z, 0, radius};
                    rtcPointQuery(scene->scene, &query, &context, visit, &search);
                }
            }};
}

RayCaster Embree::rays() const {
    return {"Embree rtcIntersect1", [scene = scene_](std::span<const Ray> rays, std::span<RayHit> hits) {
                RTCIntersectContext context;
                rtcInitIntersectContext(&context);
                for (std::size_t i = 0; i < rays.size(); ++i) {
                    const auto& [from, along, length] = rays[i];
                    RTCRayHit ray{};
                    ray.ray = {from.x, from.y, from.z, 0, along.x, along.y, along.z, 0, length, ~0u, 0, 0};
                    ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
                    rtcIntersect1(scene->scene, &context, &ray);
                    hits[i] = missed;
                    if (ray.hit.geomID == RTC_INVALID_GEOMETRY_ID) continue;
                    hits[i].distance = ray.ray.tfar;
                    hits[i].position = from + ray.ray.tfar * along;
                    hits[i].normal = glm::normalize(glm::vec3(ray.hit.Ng_x, ray.hit.Ng_y, ray.hit.Ng_z));
                }
            }};
}

}  // namespace bilayer::bench
