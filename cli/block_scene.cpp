// SPDX-License-Identifier: Apache-2.0
#include "cli/block_scene.h"

#include <algorithm>
#include <utility>

#include "core/error.h"
#include "vdb/block_renderer.h"
#include "vdb/model_file.h"

namespace nerfvdb {
namespace {

constexpr std::size_t kKept = 4;  // blocks in memory: as many as meet in a corner

std::filesystem::path folderOf(const std::filesystem::path& path) {
    return std::filesystem::is_directory(path) ? path : path.parent_path();
}

}  // namespace

Model loadBlock(const std::filesystem::path& folder, const BlockId& block) {
    const std::filesystem::path path = blockPath(folder, block);
    if (!std::filesystem::exists(path))
        throw IoError(path.string(), "no file", "the model of block " + blockName(block),
                      "train it: nerfvdb train DATA --out " + folder.string() + " --blocks NxM --block " + blockName(block));
    return loadModel(path);
}

std::vector<BlockId> trainedBlocks(const BlockIndex& index, const std::filesystem::path& folder) {
    std::vector<BlockId> blocks = index.grid.blocks();
    std::erase_if(blocks, [&](const BlockId& block) { return !index.isTrained(block); });
    if (blocks.empty())
        throw DataError(folder.string(), "no block with photographs enough", "at least one",
                        "train again with fewer blocks");
    return blocks;
}

BlockScene::BlockScene(const std::filesystem::path& folder, Open open)
    : folder_(folderOf(folder)), index_(readBlockIndex(folder)), blocks_(trainedBlocks(index_, folder)),
      open_(std::move(open)) {}

RenderedImage BlockScene::render(const Camera& camera) const {
    std::vector<RenderedImage> pictures;
    std::vector<double> weights;
    double total = 0;
    for (const BlockId& block : blocks_) {
        const double weight = index_.grid.weight(block, camera.position);
        if (weight <= 0) continue;
        pictures.push_back(load(block).render(camera));
        weights.push_back(weight);
        total += weight;
    }
    if (pictures.empty()) {  // over a block without photographs: the nearest that has some
        const auto distance = [&](const BlockId& block) {
            return (index_.grid.coreBox(block).center() - camera.position).squaredNorm();
        };
        return load(*std::min_element(blocks_.begin(), blocks_.end(), [&](const BlockId& a, const BlockId& b) {
                   return distance(a) < distance(b);
               }))
            .render(camera);
    }
    for (double& weight : weights) weight /= total;
    return blendPictures(pictures, weights);
}

Vec3f BlockScene::background() const { return load(blocks_.front()).background(); }

const Scene& BlockScene::load(const BlockId& block) const {
    const auto known =
        std::find_if(loaded_.begin(), loaded_.end(), [&](const Loaded& loaded) { return loaded.block == block; });
    if (known != loaded_.end()) {
        loaded_.splice(loaded_.begin(), loaded_, known);
    } else {
        if (loaded_.size() == kKept) loaded_.pop_back();
        loaded_.push_front({block, open_(loadBlock(folder_, block))});
    }
    return *loaded_.front().scene;
}

}  // namespace nerfvdb
