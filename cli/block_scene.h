// SPDX-License-Identifier: Apache-2.0
// A folder of blocks as one scene.
#pragma once

#include <filesystem>
#include <functional>
#include <list>
#include <memory>

#include "cli/scene.h"
#include "trainer/block_index.h"
#include "vdb/model.h"

namespace nerfvdb {

/// The model of a block. Throws IoError naming what is missing and the command that makes it, or as loadModel.
Model loadBlock(const std::filesystem::path& folder, const BlockId& block);

/// Blocks that have, or should have, a model, in the order of BlockGrid::blocks. Throws DataError if there are none.
std::vector<BlockId> trainedBlocks(const BlockIndex& index, const std::filesystem::path& folder);

/// Renders each view with the blocks near its camera and fades between them (BlockGrid::weight); the others are neither
/// read nor rendered. Keeps the few blocks that were used last.
class BlockScene : public Scene {
public:
    /// Makes a scene of one block. Called when a view needs it.
    using Open = std::function<std::unique_ptr<Scene>(Model model)>;

    /// `folder`: or its blocks.json.
    BlockScene(const std::filesystem::path& folder, Open open);
    RenderedImage render(const Camera& camera) const override;
    Vec3f background() const override;  // of the first block
    Box occupiedBox() const override { return index_.grid.region(); }

private:
    struct Loaded {
        BlockId block;
        std::unique_ptr<Scene> scene;
    };
    const Scene& load(const BlockId& block) const;

    std::filesystem::path folder_;
    BlockIndex index_;
    std::vector<BlockId> blocks_;
    Open open_;
    mutable std::list<Loaded> loaded_;  // the last used first
};

}  // namespace nerfvdb
