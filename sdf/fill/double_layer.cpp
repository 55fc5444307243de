// SPDX-License-Identifier: Apache-2.0
// The double layer method, one brick at a time: triangles, samples, blocks. Only the bins of the triangles are stored
// for the whole mesh. Memory is therefore a fraction of the mesh's, at any sample count.
#include "sdf/fill/double_layer.h"

#include <oneapi/tbb/enumerable_thread_specific.h>
#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "sdf/base/progress.h"
#include "sdf/fill/layer_block.h"
#include "sdf/fill/layer_samples.h"
#include "sdf/fill/triangle_bins.h"
#include "sdf/leaf/build_options.h"

namespace bilayer::detail {
namespace {

// Working memory of a thread, reused for each brick.
struct LayerBrickScratch {
    LayerSamples samples;
    LayerScratch block;
    std::vector<glm::ivec3> origins;
    std::vector<float> distances;
    std::vector<std::int32_t> triangles;
};

class LayerBrickFiller {
  public:
    LayerBrickFiller(const MeshJob& job, const DoubleLayerOptions& options, const FillParameters& parameters,
                     float reach, const TriangleBins& bins, LayerBrickScratch& scratch)
        : job_(job), options_(options), parameters_(parameters), reach_(reach), bins_(bins), s_(scratch) {}

    void fill(std::size_t brick) {
        const glm::ivec3 origin = bins_.origins[brick];
        if (job_.wanted && !job_.wanted(origin, bins_.side)) return;
        sample(brick, origin);
        const int blocks = bins_.side / blockSide;
        s_.origins.clear();
        for (int x = 0; x < blocks; ++x)
            for (int y = 0; y < blocks; ++y)
                for (int z = 0; z < blocks; ++z) fillBlock(origin, blockSide * glm::ivec3(x, y, z));
        if (!s_.origins.empty()) job_.sink({s_.origins, s_.distances, s_.triangles});
    }

  private:
    void sample(std::size_t brick, const glm::ivec3& origin) {
        s_.samples.begin(SampledBrick{origin, bins_.side, reach_, 1.0 / double(job_.voxelSize), options_});
        const std::span<const std::uint32_t> triangles = bins_.trianglesOf(brick);
        for (std::size_t i = 0; i < triangles.size(); i += trianglesPerPoll) {
            job_.progress.poll();
            s_.samples.add(job_.mesh, triangles.subspan(i, std::min(trianglesPerPoll, triangles.size() - i)));
        }
        s_.samples.finish();
    }

    void fillBlock(const glm::ivec3& origin, const glm::ivec3& inBrick) {
        if (job_.wanted && !job_.wanted(origin + inBrick, blockSide)) return;
        job_.progress.poll();
        const std::size_t first = s_.origins.size() * blockVoxels;
        if (s_.distances.size() == first) s_.distances.resize(first + blockVoxels);
        if (job_.triangles) s_.triangles.resize(s_.distances.size());
        if (fillLayerBlock({s_.samples, inBrick, parameters_}, s_.block, s_.distances.data() + first,
                           job_.triangles ? s_.triangles.data() + first : nullptr))
            s_.origins.push_back(origin + inBrick);
    }

    const MeshJob& job_;
    const DoubleLayerOptions& options_;
    const FillParameters& parameters_;
    float reach_;
    const TriangleBins& bins_;
    LayerBrickScratch& s_;
};

}  // namespace

void fillDoubleLayer(const MeshJob& job, const Bounds& box, const DoubleLayerOptions& options,
                     const FillParameters& parameters) {
    const float reach = layerReach(parameters);
    const TriangleBins bins = binTriangles(job.mesh, box, 1.0 / double(job.voxelSize), reach, &job.progress);
    job.progress.begin(bins.count());
    tbb::enumerable_thread_specific<LayerBrickScratch> scratch;
    tbb::parallel_for(std::size_t(0), bins.count(), [&](std::size_t brick) {
        LayerBrickFiller(job, options, parameters, reach, bins, scratch.local()).fill(brick);
        job.progress.advance();
    });
    if (job.undecided)
        for (const LayerBrickScratch& one : scratch) *job.undecided += one.block.undecided;
}

}  // namespace bilayer::detail
