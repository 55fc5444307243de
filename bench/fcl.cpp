// SPDX-License-Identifier: Apache-2.0
#include "bench/fcl.h"

#include <fcl/geometry/bvh/BVH_model.h>
#include <fcl/math/bv/OBBRSS.h>
#include <fcl/narrowphase/collision_object.h>
#include <fcl/narrowphase/distance.h>

namespace bilayer::bench {

namespace {

fcl::Transform3d transformOf(const Pose& pose) {
    const glm::dquat rotation = glm::normalize(glm::dquat(pose.rotation));
    fcl::Transform3d transform = fcl::Transform3d::Identity();
    transform.linear() = fcl::Quaterniond(rotation.w, rotation.x, rotation.y, rotation.z).toRotationMatrix();
    transform.translation() = fcl::Vector3d(double(pose.position.x), double(pose.position.y), double(pose.position.z));
    return transform;
}

}  // namespace

struct FclMesh::Data {
    std::shared_ptr<fcl::BVHModel<fcl::OBBRSSd>> model = std::make_shared<fcl::BVHModel<fcl::OBBRSSd>>();
};

FclMesh::FclMesh(const Mesh& mesh) : data_(std::make_unique<Data>()) {
    std::vector<fcl::Vector3d> points;
    std::vector<fcl::Triangle> triangles;
    for (const glm::vec3& p : mesh.points) points.emplace_back(double(p.x), double(p.y), double(p.z));
    for (const glm::uvec3& t : mesh.triangles) triangles.emplace_back(t.x, t.y, t.z);
    data_->model->beginModel(int(triangles.size()), int(points.size()));
    data_->model->addSubModel(points, triangles);
    data_->model->endModel();
}
FclMesh::~FclMesh() = default;
FclMesh::FclMesh(FclMesh&&) noexcept = default;

double FclMesh::distanceTo(const FclMesh& other, const Pose& pose, const Pose& poseOther) const {
    fcl::DistanceRequestd request;
    fcl::DistanceResultd result;
    return fcl::distance(data_->model.get(), transformOf(pose), other.data_->model.get(), transformOf(poseOther),
                         request, result);
}

}  // namespace bilayer::bench
