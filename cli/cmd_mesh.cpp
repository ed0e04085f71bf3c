// SPDX-License-Identifier: Apache-2.0
// nerfvdb mesh: the surface of a model as triangles.
#include "cli/commands.h"
#include "cli/mesh_comparison.h"
#include "cli/mesh_rework.h"
#include "cli/mesh_source.h"
#include "cli/output_path.h"
#include "cli/process.h"
#include "cli/quantities.h"
#include "cli/shell_words.h"
#include "core/error.h"
#include "export/marching_cubes.h"
#include "export/mesh_io.h"

namespace nerfvdb {
namespace {

struct MeshWords {
    std::string model, out, compare, iso = "auto", up;
    bool no_colours = false, fill_inside = false;
    std::vector<double> bounds, origin;
    int resolution = 0;
    std::string method = "marching-cubes";
    double adaptivity = 0;
    bool stream = false, open = false;
    ShellWords shells;
    ReworkWords rework;
    SharedOptions shared;
};

/// What can be refused before long work.
void checkWords(const MeshWords& words) {
    checkRework(words.rework);
    if (words.out.empty()) {
        if (words.compare.empty()) throw UsageError("mesh", "no --out", "a file to write, or --compare");
        if (!words.up.empty()) throw UsageError("--up", "no --out", "a .glb file to write");
        if (words.stream) throw UsageError("--stream", "no --out", "a .ply file to write");
        return;
    }
    if (meshFormat(words.out) != MeshFormat::glb && !words.up.empty())
        throw UsageError("--up", "a file that is not .glb", "no --up", "other formats do not say which axis is up");
    if (words.stream && (asksForWork(words.rework) || !words.compare.empty() || words.open))
        throw UsageError("--stream", "an option that needs the whole mesh",
                         "no --compare, no --open, and nothing on islands, smoothing and simplification",
                         "a stream keeps every piece");
    prepareOutputFile("--out", words.out);
    if (!words.compare.empty() && std::filesystem::exists(words.out) && std::filesystem::equivalent(words.out, words.compare))
        throw UsageError("--out", "the mesh to compare with", "another file", "it would be overwritten");
}

/// The mesh is never in memory, so nothing about its pieces is known, and none is dropped.
void streamMesh(const MeshWords& words, const MeshSource& source, MeshOptions options, const Vec3d& origin,
                TerminalReport& report) {
    if (!source.hasFeatures() && !words.no_colours)
        throw UsageError("--stream", "a folder of blocks", "--no-colours too", "colours are added block by block, at the end");
    const Model& model = source.model();
    options.colours = !words.no_colours;
    streamPly(words.out, model, options, report);
    report.end();
    const auto bytes = std::filesystem::file_size(words.out);
    words.shared.finish({{"command", "mesh"},
                         {"out", words.out},
                         {"iso", options.iso.value_or(automaticIso(model.field))},
                         {"origin", {origin.x(), origin.y(), origin.z()}},
                         {"file_bytes", bytes},
                         {"peak_memory_bytes", peakMemoryBytes()}},
                        formatted("%s: %s\n", words.out.c_str(), sizeText(static_cast<double>(bytes)).c_str()));
}

void runMesh(const MeshWords& words) {
    const auto limit = words.shared.begin();
    checkWords(words);
    const Mesh truth = words.compare.empty() ? Mesh{} : readPly(words.compare);
    MeshOptions options;
    options.colours = false;  // asked for once the vertices are where they will be
    options.fill_inside = words.fill_inside;
    options.open = words.open;
    options.resolution = words.resolution;
    options.method = words.method == "dual" ? SurfaceMethod::dual : SurfaceMethod::marching_cubes;
    options.adaptivity = words.adaptivity;
    const Vec3d origin = words.origin.empty() ? Vec3d(Vec3d::Zero()) : Vec3d(words.origin.data());
    if (!origin.allFinite()) throw UsageError("--origin", "no finite point", "three numbers");
    if (!words.bounds.empty()) {
        options.bounds = parseBounds("--bounds", words.bounds);
        options.bounds->min -= origin;
        options.bounds->max -= origin;
    }
    if (words.iso != "auto") {
        double iso = 0;
        if (!CLI::detail::lexical_cast(words.iso, iso))
            throw UsageError("--iso", "'" + words.iso + "'", "auto or a density in 1 / world unit");
        options.iso = iso;
    }

    TerminalReport report;
    MeshSource source(words.model, words.shells, origin, report);
    const Model& model = source.model();
    const double iso = options.iso.value_or(automaticIso(model.field));
    if (words.fill_inside) source.makeUnseenSolid(iso, report);
    if (words.stream) return streamMesh(words, source, options, origin, report);
    Mesh mesh = extractSurface(model, options, report);
    const bool had_surface = !mesh.triangles.empty();
    const IslandCounts islands = reworkMesh(mesh, words.rework, report);
    if (had_surface && mesh.triangles.empty())
        throw DataError("mesh: " + words.model, std::to_string(islands.dropped_pieces) + " pieces, all too small to be kept",
                        "one that is left", "use a smaller --min-faces");
    if (!words.out.empty()) {
        if (!words.no_colours && meshFormat(words.out) != MeshFormat::stl) source.colour(mesh, report);
        writeMesh(words.out, mesh, words.up == "y" ? UpAxis::y : UpAxis::z);
    }
    report.end();

    const MeshMeasures measures = measureMesh(mesh);
    Json json = {{"command", "mesh"},
                 {"iso", iso},
                 {"origin", {origin.x(), origin.y(), origin.z()}},
                 {"vertices", mesh.positions.size()},
                 {"faces", mesh.triangles.size()},
                 {"pieces", measures.pieces},
                 {"dropped_pieces", islands.dropped_pieces},
                 {"dropped_faces", islands.dropped_faces},
                 {"largest_piece_faces", islands.largest_faces},
                 {"closed", measures.closed()},
                 {"area", measures.area},
                 {"volume", measures.volume}};
    std::string text = formatted(
        "%s: %zu vertices, %zu faces in %zu pieces, %s, at density %.4g per world unit\n"
        "dropped as islands: %zu pieces with %zu faces\n",
        words.out.empty() ? words.model.c_str() : words.out.c_str(), mesh.positions.size(), mesh.triangles.size(),
        measures.pieces, measures.closed() ? "closed" : "not closed", iso, islands.dropped_pieces,
        islands.dropped_faces);
    if (!words.out.empty()) {
        const auto bytes = std::filesystem::file_size(words.out);
        json["out"] = words.out;
        json["file_bytes"] = bytes;
        text += formatted("%s: %s\n", words.out.c_str(), sizeText(static_cast<double>(bytes)).c_str());
    }
    if (!words.compare.empty()) {
        const double voxel_size = model.field.frame().voxel_size;
        const MeshComparison comparison = compareMeshes(mesh, truth, {.threshold = voxel_size});
        json["comparison"] = comparisonJson(comparison, voxel_size);
        text += comparisonText(comparison, voxel_size);
    }
    json["peak_memory_bytes"] = peakMemoryBytes();
    words.shared.finish(json, text);
}

}  // namespace

Command addMesh(CLI::App& program) {
    auto words = std::make_shared<MeshWords>();
    CLI::App& app =
        *program.add_subcommand("mesh", "Extract the surface of a model as a coloured triangle mesh");
    app.add_option("MODEL", words->model, "A model or a folder of blocks that 'nerfvdb train' made")->required();
    app.add_option("--out", words->out,
                   "The mesh: .ply, .obj, .glb (glTF) or .stl (no colours); none has texture coordinates")
        ->type_name("FILE");
    app.add_option("--compare", words->compare,
                   "Measure distances to this mesh (.ply, binary, triangles; its origin is that of --origin), with or without "
                   "--out")
        ->type_name("TRUTH.ply");
    app.add_option(
           "--iso", words->iso,
           "Density at the surface, 1 / world unit; auto stops half of the light over one voxel, and in fog "
           "is half of the largest [auto]")
        ->type_name("DENSITY");
    app.add_option("--bounds", words->bounds, "Only this box, world units; closed at the nearest voxel planes")
        ->expected(6)
        ->delimiter(',')
        ->type_name("X0,Y0,Z0,X1,Y1,Z1");
    app.add_option("--origin", words->origin,
                   "The point of the model's world that is 0, 0, 0 in the file, whose 32-bit floats are coarse far from it "
                   "(as in map coordinates) [0,0,0]")
        ->expected(3)
        ->delimiter(',')
        ->type_name("X,Y,Z");
    app.add_option("--resolution", words->resolution,
                   "Voxels along the longest side of the scene's box: larger or smaller triangles [the model's]")
        ->check(CLI::Range(1, kMostResolution))
        ->type_name("N");
    app.add_option("--method", words->method,
                   "marching-cubes, or dual: OpenVDB's volumeToMesh as a second opinion, not always manifold "
                   "[marching-cubes]")
        ->check(CLI::IsMember({"marching-cubes", "dual"}))
        ->type_name("NAME");
    app.add_option("--adaptivity", words->adaptivity, "Larger faces of the dual method where it is flat, 0 to 1 [0]")
        ->check(CLI::Range(0.0, 1.0))
        ->type_name("X");
    app.add_flag("--stream", words->stream,
                 "Write a .ply part by part: for meshes larger than memory; pieces are then neither known nor dropped, and colours "
                 "are decoded where vertices are instead of collected from the cameras' rays");
    app.add_flag("--fill-inside", words->fill_inside,
                 "Make bodies solid: no surfaces behind those that the photographs show, nor of cavities that nothing leads "
                 "into from outside");
    app.add_flag("--open", words->open,
                 "Leave out the faces that only close the surface: where --bounds cut it, and where what the photographs show "
                 "ends, such as under a ground");
    app.add_flag("--no-colours", words->no_colours, "Leave out the vertex colours");
    words->shells.add(app);
    addRework(app, words->rework);
    app.add_option("--up", words->up, "The axis of the model's world that .glb is told points up: y or z [z]")
        ->check(CLI::IsMember({"y", "z"}))
        ->type_name("AXIS");
    words->shared.add(app,
                      "  nerfvdb mesh lego.vdb --out lego.ply\n"
                      "  nerfvdb mesh lego.vdb --out lego.glb --fill-inside --smooth 10 --faces 200000\n"
                      "  nerfvdb mesh shell.vdb --compare data/shell/truth.ply");
    return {&app, [words] { runMesh(*words); }};
}

}  // namespace nerfvdb
