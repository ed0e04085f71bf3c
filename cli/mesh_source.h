// SPDX-License-Identifier: Apache-2.0
// What a mesh is made of: a model, or a folder of blocks put together.
#pragma once

#include <filesystem>
#include <optional>

#include "cli/shell_words.h"
#include "core/report.h"
#include "export/mesh.h"
#include "export/unseen_solid.h"
#include "trainer/block_index.h"
#include "vdb/model.h"

namespace nerfvdb {

class MeshSource {
public:
    /// A folder of blocks has density alone in memory. `origin`: the point of the model's world that is the mesh's origin.
    /// Throws as loadModel and loadBlock; UsageError for --shells of blocks.
    MeshSource(const std::filesystem::path& path, const ShellWords& shells, const Vec3d& origin, Report& report);

    /// Of blocks: their density joined, without features.
    const Model& model() const { return model_; }
    bool hasFeatures() const { return !index_; }
    /// Makes solid what no camera sees behind a surface at `iso`; nothing of blocks, which do not tell their cameras.
    void makeUnseenSolid(double iso, Report& report) { nerfvdb::makeUnseenSolid(model_, iso, report); }
    /// Sets the colours of a mesh near the surface, of blocks one after another by whose vertex it is.
    void colour(Mesh& mesh, Report& report) const;

private:
    std::filesystem::path folder_;
    Vec3d origin_;
    std::optional<BlockIndex> index_;
    Model model_;
};

}  // namespace nerfvdb
