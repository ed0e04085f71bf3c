// SPDX-License-Identifier: Apache-2.0
#include "cli/scene_words.h"

#include "cli/block_scene.h"
#include "cli/foreign_vdb.h"
#include "cli/quantities.h"
#include "core/error.h"
#include "vdb/model_file.h"
#include "vdb/renderer.h"
#include "vdb/volume_file.h"
#include "vdb/volume_renderer.h"

namespace nerfvdb {
namespace {

/// Box of the leaves: tighter than the box in which training looked.
Box leafBox(const Topology& topology, const GridFrame& frame) {
    const auto leaves = topology.leafCoords();
    Vec3i low = Vec3i::Zero(), high = topology.dims() / kLeafDim - Vec3i::Ones();
    if (!leaves.empty()) low = high = leaves.front();
    for (const Vec3i& leaf : leaves) {
        low = low.cwiseMin(leaf);
        high = high.cwiseMax(leaf);
    }
    return {frame.worldFromIndex((low * kLeafDim).cast<double>()),
            frame.worldFromIndex(((high + Vec3i::Ones()) * kLeafDim).cast<double>())};
}

class ModelScene : public Scene {
public:
    ModelScene(Model model, const RenderOptions& options) : model_(std::move(model)), renderer_(model_, options) {}
    RenderedImage render(const Camera& camera) const override { return renderer_.render(camera); }
    Vec3f background() const override { return model_.background; }
    Box occupiedBox() const override {
        const VoxelField& field = model_.field;
        return field.shells().count > 1 ? field.shellBox(0) : leafBox(field.topology(), field.frame());
    }

private:
    Model model_;
    Renderer renderer_;
};

class VolumeScene : public Scene {
public:
    VolumeScene(Volume volume, const VolumeRenderOptions& options)
        : volume_(std::move(volume)), options_(options), renderer_(volume_, options) {}
    RenderedImage render(const Camera& camera) const override { return renderer_.render(camera); }
    Vec3f background() const override { return options_.background; }
    Box occupiedBox() const override {
        const Box grid = leafBox(volume_.topology(), volume_.frame());
        Box box{volume_.worldFromGrid().apply(grid.min), volume_.worldFromGrid().apply(grid.min)};
        for (int corner = 0; corner < 8; ++corner) {
            const Vec3d at = volume_.worldFromGrid().apply(
                Vec3d(corner & 4 ? grid.max.x() : grid.min.x(), corner & 2 ? grid.max.y() : grid.min.y(),
                      corner & 1 ? grid.max.z() : grid.min.z()));
            box.min = box.min.cwiseMin(at);
            box.max = box.max.cwiseMax(at);
        }
        return box;
    }

private:
    Volume volume_;
    VolumeRenderOptions options_;
    VolumeRenderer renderer_;
};

}  // namespace

void SceneWords::add(CLI::App& command) {
    command
        .add_option("MODEL", path_,
                    "A model or a folder of blocks that 'nerfvdb train' made, or any .vdb with the grids 'density' and 'color'")
        ->required();
    command
        .add_option("--background", background_,
                    "Behind the scene: white, black or R,G,B in [0, 1], sRGB [as in the file, else white]")
        ->type_name("COLOUR");
    command.add_flag("--no-view-dependence", no_view_dependence_,
                     "Give each point of a model the same colour from all sides, as plain volumes have it");
}

std::unique_ptr<Scene> SceneWords::load(bool normals) const {
    std::optional<Vec3f> background;
    if (!background_.empty()) background = parseColor("--background", background_);
    const auto modelScene = [=, diffuse = no_view_dependence_](Model model) {
        if (background) model.background = *background;
        RenderOptions options;
        options.normals = normals;
        options.view_dependent = !diffuse;
        return std::make_unique<ModelScene>(std::move(model), options);
    };
    if (isBlockFolder(path_)) return std::make_unique<BlockScene>(path_, modelScene);
    if (!isVdbFile(path_) || isModelFile(path_)) return modelScene(loadModel(path_));
    tryForeignVdb(path_);
    VolumeFile file = readVolume(path_);
    VolumeRenderOptions options;
    options.normals = normals;
    options.background = background.value_or(file.background.value_or(Vec3f::Ones()));
    return std::make_unique<VolumeScene>(std::move(file.volume), options);
}

}  // namespace nerfvdb
