// SPDX-License-Identifier: Apache-2.0
#include "bench/mesh_rates.h"

#include <algorithm>
#include <iterator>
#include <memory>

#include "bench/mesh_peers.h"
#include "bench/peak_memory.h"
#include "bench/repeat.h"
#include "bench/result_plot.h"
#include "bench/scratch_folder.h"
#include "bench/surface_scene.h"
#include "core/parallel.h"
#include "export/marching_cubes.h"
#include "export/vdb_export.h"
#include "vdb/volume_file.h"

namespace nerfvdb {
namespace {

constexpr int kWriteChannels = 8;

std::string threadsText(int n) { return std::to_string(n) + (n == 1 ? " thread" : " threads"); }

MeshPeer ownExtraction(const Model& model) {
    return {"nerfvdb", [&model] {
                Report silent;
                const double iso = sigmaFromRaw(kSceneIsoRaw, model.field.densityScale());
                const Mesh mesh = extractSurface(model, {.iso = iso, .colours = false}, silent);
                return PeerMesh{mesh.triangles.size(), mesh.positions.size() * sizeof(mesh.positions[0]) +
                                                           mesh.normals.size() * sizeof(mesh.normals[0]) +
                                                           mesh.triangles.size() * sizeof(mesh.triangles[0])};
            }};
}

void benchExtraction(const SurfaceScene& scene, const MeshRateOptions& options, Report& report,
                     BenchResult& result) {
    std::vector<MeshPeer> ways = {ownExtraction(scene.model),
                                  volumeToMeshPeer(scene.model.field, kSceneIsoRaw)};
    if (auto flying_edges = flyingEdgesPeer(scene.model.field, kSceneIsoRaw)) ways.push_back(*flying_edges);
    std::vector<int> counts = {1};
    if (threadCount() > 1) counts.push_back(threadCount());

    std::vector<std::function<void()>> bodies;
    std::vector<BenchRow> rows;
    for (const int threads : counts)
        for (const MeshPeer& way : ways) {
            BenchRow row{scene.name + ", " + threadsText(threads), way.name,
                         std::vector<std::vector<double>>(7)};
            const ThreadLimit limit(threads);
            const PeakMemory memory;
            const PeerMesh made = way.extract();
            row.cells[2] = {static_cast<double>(made.triangles)};
            row.cells[5] = {static_cast<double>(memory.extraBytes()) / static_cast<double>(made.bytes)};
            rows.push_back(std::move(row));
            bodies.push_back([&way, threads] {
                const ThreadLimit own_limit(threads);
                way.extract();
            });
        }
    const std::vector<Timing> timings =
        timeInTurn(bodies, {.repeats = options.repeats, .warm_up = false}, "surfaces", report);
    for (std::size_t r = 0; r < rows.size(); ++r) {
        rows[r].cells[0] = timings[r].wall_s, rows[r].cells[1] = timings[r].cpu_s;
        for (const double seconds : timings[r].wall_s)
            rows[r].cells[3].push_back(rows[r].cells[2][0] / seconds);
        for (const double seconds : timings[r].cpu_s) rows[r].cells[4].push_back(rows[r].cells[2][0] / seconds);
        result.rows.push_back(std::move(rows[r]));
    }
    result.figures.emplace_back("active voxels, " + scene.name,
                                static_cast<double>(scene.model.field.topology().voxelCount()));
}

void benchWriting(const MeshRateOptions& options, Report& report, BenchResult& result) {
    const ScratchFolder folder(options.scratch);
    // Half the resolution: decoding a colour takes longer than all the rest.
    const SurfaceScene scene = bumpyShell(std::max(options.resolution / 2, 2 * kLeafDim), kWriteChannels);
    struct Made {
        std::string what;
        ExportVdbOptions options;
        std::filesystem::path path;
        double voxels = 0;
    };
    const std::vector<std::pair<std::string, ExportVdbOptions::Color>> kinds = {
        {"density", ExportVdbOptions::Color::none}, {"density and color", ExportVdbOptions::Color::diffuse}};
    Report silent;  // of each export: the benchmark reports itself
    std::vector<Made> volumes;
    std::vector<std::function<void()>> bodies;
    for (const auto& [what, color] : kinds) {
        Made volume{what, {}, folder / (what + ".vdb")};
        volume.options.color = color;
        volume.voxels = static_cast<double>(exportVdb(scene.model, volume.path, volume.options, silent).active_voxels);
        bodies.push_back([&scene, &silent, volume] { exportVdb(scene.model, volume.path, volume.options, silent); });
        bodies.push_back([written = std::make_shared<const VolumeFile>(readVolume(volume.path)),
                          has_color = volume.options.color != ExportVdbOptions::Color::none,
                          to = folder / (what + " alone.vdb")] {
            WriteVolumeOptions write;
            write.color = has_color;
            writeVolume(to, written->volume, write);
        });
        bodies.push_back(plainWriter(volume.path, folder / (what + " again.vdb")));
        volumes.push_back(std::move(volume));
    }
    const std::vector<Timing> timings =
        timeInTurn(bodies, {.repeats = options.repeats, .warm_up = false}, "volumes", report);
    for (std::size_t b = 0; b < bodies.size(); ++b) {
        constexpr const char* kWays[] = {"nerfvdb export", "nerfvdb writing", "OpenVDB writing"};
        const Made& volume = volumes[b / std::size(kWays)];
        BenchRow row{"making a .vdb, " + volume.what + ", " + threadsText(threadCount()), kWays[b % std::size(kWays)],
                     std::vector<std::vector<double>>(7)};
        row.cells[0] = timings[b].wall_s, row.cells[1] = timings[b].cpu_s;
        for (const double seconds : timings[b].wall_s) row.cells[6].push_back(volume.voxels / seconds);
        result.rows.push_back(std::move(row));
    }
}

}  // namespace

BenchResult benchMesh(const MeshRateOptions& options, Report& report) {
    BenchResult result;
    result.kind = "mesh";
    result.title = "Surfaces and volumes, boxes of " + std::to_string(options.resolution) + "^3 voxels";
    result.facts = gatherFacts();
    result.columns = {secondsColumn("seconds"),
                      secondsColumn("cpu_seconds"),
                      {"triangles", "", Better::neither, Noise::exact},
                      {"triangles_per_s", "1/s", Better::higher, Noise::timed, 0.03, 0},
                      {"triangles_per_cpu_s", "1/s", Better::higher, Noise::timed, 0.03, 0},
                      {"memory_over_output", "", Better::lower, Noise::noisy, 0.05, 0},
                      {"voxels_per_s", "1/s", Better::higher, Noise::timed, 0.03, 0}};
    for (const auto& sceneOf : {&bumpyShell, &gyroidBall})
        benchExtraction(sceneOf(options.resolution, 0), options, report, result);
    if (!options.scratch.empty()) benchWriting(options, report, result);
    result.notes.push_back(
        "memory: the peak during one extraction beyond what was in use before, over the bytes of "
        "the mesh; normals are part of nerfvdb's and VTK's time and bytes, OpenVDB makes none");
    return result;
}

Plot meshPlot(const BenchResult& result) {
    Plot plot = plotByLabel(result, "triangles_per_s");
    plot.x.label = "triangles a second";
    plot.x.begins_at_zero = true;
    return plot;
}

}  // namespace nerfvdb
