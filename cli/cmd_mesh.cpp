// SPDX-License-Identifier: Apache-2.0
// nerfvdb mesh: the surface of a model as triangles.
#include "cli/commands.h"
#include "cli/output_path.h"
#include "cli/process.h"
#include "cli/quantities.h"
#include "core/error.h"
#include "export/marching_cubes.h"
#include "export/mesh_cleanup.h"
#include "export/mesh_io.h"
#include "vdb/model_file.h"

namespace nerfvdb {
namespace {

struct MeshWords {
    std::string model, out, iso = "auto";
    IslandOptions islands;
    bool no_colours = false, fill_inside = false;
    std::vector<double> bounds;
    int resolution = 0;
    std::string method = "marching-cubes";
    double adaptivity = 0;
    bool stream = false;
    SharedOptions shared;
};

/// The mesh is never in memory, so nothing about its pieces is known.
void streamMesh(const MeshWords& words, const Model& model, const MeshOptions& options, TerminalReport& report) {
    if (words.islands.keep_largest || words.islands.min_faces)
        throw UsageError("--stream", "--keep-largest or --min-faces", "neither: pieces are not known part by part");
    streamPly(words.out, model, options, report);
    report.end();
    const auto bytes = std::filesystem::file_size(words.out);
    words.shared.finish({{"command", "mesh"},
                         {"out", words.out},
                         {"iso", options.iso.value_or(automaticIso(model.field))},
                         {"file_bytes", bytes},
                         {"peak_memory_bytes", peakMemoryBytes()}},
                        formatted("%s: %s\n", words.out.c_str(), sizeText(static_cast<double>(bytes)).c_str()));
}

void runMesh(const MeshWords& words) {
    const auto limit = words.shared.begin();
    checkMeshPath(words.out);
    prepareOutputFile("--out", words.out);
    MeshOptions options;
    options.colours = !words.no_colours;
    options.fill_inside = words.fill_inside;
    options.resolution = words.resolution;
    options.method = words.method == "dual" ? SurfaceMethod::dual : SurfaceMethod::marching_cubes;
    options.adaptivity = words.adaptivity;
    if (!words.bounds.empty()) options.bounds = parseBounds("--bounds", words.bounds);
    if (words.iso != "auto") {
        double iso = 0;
        if (!CLI::detail::lexical_cast(words.iso, iso))
            throw UsageError("--iso", "'" + words.iso + "'", "auto or a density in 1 / world unit");
        options.iso = iso;
    }

    TerminalReport report;
    const Model model = loadModel(words.model);
    if (words.stream) return streamMesh(words, model, options, report);
    const double iso = options.iso.value_or(automaticIso(model.field));
    Mesh mesh = extractSurface(model, options, report);
    report.end();
    const IslandCounts islands = removeIslands(mesh, words.islands);
    writeMesh(words.out, mesh);

    const MeshMeasures measures = measureMesh(mesh);
    const auto bytes = std::filesystem::file_size(words.out);
    words.shared.finish(
        {{"command", "mesh"},
         {"out", words.out},
         {"iso", iso},
         {"vertices", mesh.positions.size()},
         {"faces", mesh.triangles.size()},
         {"pieces", measures.pieces},
         {"dropped_pieces", islands.dropped_pieces},
         {"dropped_faces", islands.dropped_faces},
         {"closed", measures.closed()},
         {"area", measures.area},
         {"volume", measures.volume},
         {"file_bytes", bytes},
         {"peak_memory_bytes", peakMemoryBytes()}},
        formatted("%s: %zu vertices, %zu faces in %zu pieces, %s, at density %.4g per world unit, %s\n",
                  words.out.c_str(), mesh.positions.size(), mesh.triangles.size(), measures.pieces,
                  measures.closed() ? "closed" : "not closed", iso,
                  sizeText(static_cast<double>(bytes)).c_str()));
}

}  // namespace

Command addMesh(CLI::App& program) {
    auto words = std::make_shared<MeshWords>();
    CLI::App& app =
        *program.add_subcommand("mesh", "Extract the surface of a model as a coloured triangle mesh");
    app.add_option("MODEL", words->model, "A model that 'nerfvdb train' made")->required();
    app.add_option("--out", words->out, "The mesh: .ply (binary) or .obj")->required()->type_name("FILE");
    app.add_option(
           "--iso", words->iso,
           "Density at the surface, 1 / world unit; auto stops half of the light over one voxel, and in fog "
           "is half of the largest [auto]")
        ->type_name("DENSITY");
    app.add_option("--keep-largest", words->islands.keep_largest, "Keep the N largest pieces only")
        ->check(CLI::PositiveNumber)
        ->type_name("N");
    app.add_option("--min-faces", words->islands.min_faces, "Drop pieces of fewer triangles")
        ->check(CLI::PositiveNumber)
        ->type_name("N");
    app.add_option("--bounds", words->bounds, "Only this box, world units; closed at the nearest voxel planes")
        ->expected(6)
        ->delimiter(',')
        ->type_name("X0,Y0,Z0,X1,Y1,Z1");
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
                 "Write a .ply part by part: for meshes larger than memory; pieces are then neither known nor dropped");
    app.add_flag("--fill-inside", words->fill_inside,
                 "Make bodies solid: no surfaces of cavities that nothing leads into from outside");
    app.add_flag("--no-colours", words->no_colours, "Leave out the vertex colours");
    words->shared.add(app, "  nerfvdb mesh lego.vdb --out lego.ply");
    return {&app, [words] { runMesh(*words); }};
}

}  // namespace nerfvdb
