// SPDX-License-Identifier: Apache-2.0
#include "export/vdb_export.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdio>

#include "core/error.h"
#include "core/parallel.h"
#include "export/blender_memory.h"
#include "export/cropped_model.h"
#include "export/volume_colors.h"
#include "export/volume_fit.h"
#include "export/volume_of_model.h"
#include "vdb/volume_file.h"

namespace nerfvdb {
namespace {

constexpr double kMinAlphaUnseen = 1e-3, kMinAlphaSeen = 1e-5;

// ---- Voxels ----

/// Index box of the active voxels: first and last, of topology() coordinates.
std::pair<Vec3i, Vec3i> activeBox(const Volume& volume) {
    const Topology& topology = volume.topology();
    Vec3i low = topology.dims(), high = Vec3i::Constant(-1);
    for (std::size_t leaf = 0; leaf < topology.leafCount(); ++leaf) {
        const Vec3i first = topology.leafCoords()[leaf] * kLeafDim;
        if ((first.array() >= low.array()).all() && (first.array() + kLeafDim - 1 <= high.array()).all()) continue;
        forEachBit(volume.active()[leaf], [&](int offset) {
            const Vec3i voxel = first + Vec3i(offset >> 6, offset >> 3 & 7, offset & 7);
            low = low.cwiseMin(voxel);
            high = high.cwiseMax(voxel);
        });
    }
    return {low, high};
}

std::size_t activeCount(const Volume& volume) {
    std::size_t n = 0;
    for (const LeafMask& mask : volume.active())
        for (const std::uint64_t word : mask) n += static_cast<std::size_t>(std::popcount(word));
    return n;
}

int longestSide(const Volume& volume) {
    const auto [low, high] = activeBox(volume);
    return (high - low).maxCoeff() + 1;
}

/// How much too fine a volume is, as a factor of its voxel's edge; at most 1 if it is not.
double excess(const Volume& volume, const ExportVdbOptions& options) {
    double factor = 0;
    if (options.max_resolution > 0) factor = std::max(factor, longestSide(volume) / options.max_resolution);
    if (options.max_voxels > 0)  // surfaces thin out with the square
        factor = std::max(factor, std::sqrt(static_cast<double>(activeCount(volume)) / options.max_voxels));
    if (options.max_blender_bytes > 0) {
        const auto [low, high] = activeBox(volume);
        const double bytes = blenderBytes(high - low + Vec3i::Ones(), volume.topology().leafCount(),
                                          options.color != ExportVdbOptions::Color::none);
        factor = std::max(factor, std::cbrt(bytes / options.max_blender_bytes));
    }
    return factor;
}

/// The finest volume within the limits.
Volume startVolume(const Model& model, const ExportVdbOptions& options, double min_alpha, int finer) {
    VolumeGridOptions grid;
    grid.min_alpha = min_alpha;
    grid.voxel_scale = 1.0 / finer;
    Volume volume = volumeOfModel(model.field, grid);
    if (activeCount(volume) == 0)
        throw DataError("export", "a model without density", "something to write", "train it first");
    double too_fine = 1;
    for (double factor; (factor = excess(volume, options)) > 1;) {
        // From finer voxels to the model's own; from there on any size will do.
        too_fine = grid.voxel_scale;
        grid.voxel_scale = grid.voxel_scale < 1 ? 1 : grid.voxel_scale * std::max(factor, 1.01);
        volume = volumeOfModel(model.field, grid);
        if (activeCount(volume) == 0)
            throw UsageError("export", "limits under which nothing of the scene remains", "room for more voxels");
    }
    // How many voxels a size makes was guessed: what is thinner than a voxel thins out faster than a surface.
    constexpr int kTries = 4;
    constexpr double kNearEnough = 0.97;  // of the edge
    for (int n = 0; n < kTries && grid.voxel_scale > 1 && excess(volume, options) < kNearEnough; ++n) {
        VolumeGridOptions finer_grid = grid;
        finer_grid.voxel_scale = std::sqrt(too_fine * grid.voxel_scale);
        Volume finer_volume = volumeOfModel(model.field, finer_grid);
        if (excess(finer_volume, options) > 1) {
            too_fine = finer_grid.voxel_scale;
        } else {
            grid = finer_grid;
            volume = std::move(finer_volume);
        }
    }
    return volume;
}

/// Voxels that still stop light.
std::vector<LeafMask> visibleVoxels(const Volume& volume, double min_alpha) {
    const auto min_sigma = static_cast<float>(-std::log1p(-min_alpha) / volume.frame().voxel_size);
    std::vector<LeafMask> visible(volume.active().begin(), volume.active().end());
    parallelFor(visible.size(), [&](std::size_t leaf) {
        forEachBit(volume.active()[leaf], [&](int offset) {
            const float sigma = volume.sigma()[leaf * kLeafVoxels + offset];
            if (!(sigma > 0) || sigma < min_sigma)
                visible[leaf][offset >> 6] &= ~(std::uint64_t{1} << (offset & 63));
        });
    });
    return visible;
}

/// Active voxels that lie neither in a box nor on its faces.
std::vector<LeafMask> voxelsOutside(const Volume& volume, const Box& box) {
    constexpr double kRounding = 1e-6;  // voxels: a voxel on a face is on it
    const Topology& topology = volume.topology();
    const Box inside{volume.frame().indexFromWorld(box.min) - Vec3d::Constant(kRounding),
                     volume.frame().indexFromWorld(box.max) + Vec3d::Constant(kRounding)};
    std::vector<LeafMask> outside(topology.leafCount());
    for (std::size_t leaf = 0; leaf < topology.leafCount(); ++leaf)
        forEachBit(volume.active()[leaf], [&](int offset) {
            const Vec3i voxel = topology.leafCoords()[leaf] * kLeafDim + Vec3i(offset >> 6, offset >> 3 & 7, offset & 7);
            if (!inside.contains(voxel.cast<double>())) setBit(outside[leaf], offset);
        });
    return outside;
}

// ---- Tiles ----

/// Cuts the active voxels into slabs of whole leaves along the longest side, of about equally many voxels.
std::vector<std::vector<LeafMask>> cutTiles(const Volume& volume, int n_tiles) {
    const Topology& topology = volume.topology();
    const auto [low, high] = activeBox(volume);
    int axis = 0;
    (high - low).maxCoeff(&axis);
    std::vector<std::size_t> layer(static_cast<std::size_t>(topology.dims()[axis] / kLeafDim), 0);
    for (std::size_t leaf = 0; leaf < topology.leafCount(); ++leaf)
        forEachBit(volume.active()[leaf], [&](int) { ++layer[topology.leafCoords()[leaf][axis]]; });
    const double total = static_cast<double>(activeCount(volume));
    std::vector<int> tile_of_layer(layer.size());
    double before = 0;
    for (std::size_t i = 0; i < layer.size(); ++i) {
        tile_of_layer[i] = std::min(n_tiles - 1, static_cast<int>((before + 0.5 * layer[i]) / total * n_tiles));
        before += static_cast<double>(layer[i]);
    }
    std::vector<std::vector<LeafMask>> tiles(n_tiles, std::vector<LeafMask>(topology.leafCount()));
    for (std::size_t leaf = 0; leaf < topology.leafCount(); ++leaf)
        tiles[tile_of_layer[topology.leafCoords()[leaf][axis]]][leaf] = volume.active()[leaf];
    return tiles;
}

// ---- From model to volume ----

/// What a model becomes.
struct Made {
    Volume volume;
    std::size_t n_candidates = 0;    // voxels that it could have had
    bool has_view_colors = false;
    std::optional<VolumeLoss> loss;
};

Made makeVolume(const Model& model, const ExportVdbOptions& options, int finer, Report& report) {
    const std::vector<Camera> cameras = camerasOf(model, false);
    const double min_alpha = options.min_alpha.value_or(cameras.empty() ? kMinAlphaUnseen : kMinAlphaSeen);
    Made made;
    made.volume = startVolume(model, options, min_alpha, finer);
    if (options.outside) made.volume = made.volume.restricted(voxelsOutside(made.volume, *options.outside));
    const bool is_whole = made.volume.frame().voxel_size == model.field.frame().voxel_size;
    made.n_candidates = is_whole ? model.field.topology().voxelCount() : activeCount(made.volume);
    const bool has_color = options.color != ExportVdbOptions::Color::none;
    made.has_view_colors = options.color == ExportVdbOptions::Color::diffuse && !cameras.empty();
    if (!cameras.empty()) {
        const std::vector<LeafMask> seen = collectColors(model, cameras, {}, made.volume, report);
        made.volume = made.volume.restricted(seen);
    }
    if (made.has_view_colors && options.fit_steps > 0) {
        FitOptions fit;
        fit.steps = options.fit_steps;
        VolumeFit(model, cameras, fit, made.volume).run(report);
        made.volume = made.volume.restricted(visibleVoxels(made.volume, min_alpha));
    }
    if (has_color && !made.has_view_colors) decodeColors(model, made.volume);
    if (activeCount(made.volume) == 0)
        throw DataError("export", "nothing that a camera of the model sees", "a part of the scene that was photographed",
                        "choose other bounds, or allow more voxels");
    if (!model.cameras.empty() && has_color) {
        const std::vector<Camera> held_out = camerasOf(model, true);
        made.loss = measureLoss(model, made.volume, held_out.empty() ? cameras : held_out, report);
    }
    return made;
}

/// On voxels as fine as its shapes need.
Made makeFineVolume(const Model& model, const ExportVdbOptions& options, Report& report) {
    constexpr int kFinest = 3;
    constexpr double kMostVoxels = 3e7, kToleratedLoss = 1;  // dB
    Made made = makeVolume(model, options, options.finer.value_or(1), report);
    const bool is_limited = options.max_resolution > 0 || options.max_voxels > 0 || options.max_blender_bytes > 0;
    if (options.finer || is_limited || !made.has_view_colors || options.fit_steps == 0) return made;
    for (int finer = 2; finer <= kFinest; ++finer) {
        const double growth = std::pow(finer / (finer - 1.0), 3);
        const bool is_close = made.loss->psnr > made.loss->psnr_diffuse - kToleratedLoss;
        if (is_close || growth * static_cast<double>(activeCount(made.volume)) > kMostVoxels) break;
        char text[96];
        std::snprintf(text, sizeof text, "%.1f dB from the model, which shows %.1f without view-dependence: finer voxels",
                      made.loss->psnr, made.loss->psnr_diffuse);
        report.info(text);
        made = makeVolume(model, options, finer, report);
    }
    return made;
}

void checkOptions(const ExportVdbOptions& options) {
    const auto negative = [](const char* name, double value) {
        if (!(value >= 0)) throw UsageError(name, std::to_string(value), "zero or a positive number");
    };
    negative("fit_steps", options.fit_steps);
    negative("max_resolution", options.max_resolution);
    negative("max_voxels", options.max_voxels);
    negative("max_blender_bytes", options.max_blender_bytes);
    if (options.finer && (*options.finer < 1 || *options.finer > 4))
        throw UsageError("finer", std::to_string(*options.finer), "1 to 4");
    if (options.tiles < 1 || options.tiles > 999)
        throw UsageError("tiles", std::to_string(options.tiles), "1 to 999");
    if (options.color_name.empty() || options.color_name == "density")
        throw UsageError("color_name", "'" + options.color_name + "'", "a name of its own, such as color or Cd");
}

}  // namespace

std::vector<std::filesystem::path> exportPaths(const std::filesystem::path& path, int tiles) {
    if (tiles == 1) return {path};
    std::vector<std::filesystem::path> paths;
    for (int tile = 0; tile < tiles; ++tile) {
        char number[16];
        std::snprintf(number, sizeof number, ".%03d", tile);
        paths.push_back(path.parent_path() / (path.stem().string() + number + path.extension().string()));
    }
    return paths;
}

ExportVdbReport exportVdb(const Model& whole, const std::filesystem::path& path, const ExportVdbOptions& options,
                          Report& report) {
    checkOptions(options);
    const std::optional<Model> part = options.bounds ? std::optional(croppedModel(whole, *options.bounds)) : std::nullopt;
    const Model& model = part ? *part : whole;
    Made made = makeFineVolume(model, options, report);
    Volume& volume = made.volume;
    const bool has_color = options.color != ExportVdbOptions::Color::none;

    ExportVdbReport written;
    written.active_voxels = activeCount(volume);
    written.left_out = made.n_candidates - written.active_voxels;
    written.finer = model.field.frame().voxel_size / volume.frame().voxel_size;
    written.has_view_colors = made.has_view_colors;
    written.loss = made.loss;
    const auto [low, high] = activeBox(volume);
    written.bounds = {volume.frame().worldFromIndex(low.cast<double>()),
                      volume.frame().worldFromIndex(high.cast<double>())};
    written.box_voxels = high - low + Vec3i::Ones();
    written.blender_bytes = blenderBytes(written.box_voxels, volume.topology().leafCount(), has_color);
    written.placement = placementOf(options.placement, options.placed_by.value_or(written.bounds));
    volume.place(written.placement);
    written.voxel_size = volume.frame().voxel_size;

    WriteVolumeOptions write;
    write.half = options.half;
    write.color = has_color;
    write.color_name = options.color_name;
    write.background = model.background;
    const std::vector<std::filesystem::path> paths = exportPaths(path, options.tiles);
    const auto writeOne = [&](const std::filesystem::path& to, const Volume& tile) {
        const WrittenVolume one = writeVolume(to, tile, write);
        written.files.push_back({to, one.active_voxels, one.bytes});
        written.bytes += one.bytes;
        written.half = one.half;
    };
    if (options.tiles == 1) {
        writeOne(path, volume);
    } else {
        const std::vector<std::vector<LeafMask>> tiles = cutTiles(volume, options.tiles);
        for (std::size_t tile = 0; tile < tiles.size(); ++tile) writeOne(paths[tile], volume.restricted(tiles[tile]));
    }
    return written;
}

}  // namespace nerfvdb
