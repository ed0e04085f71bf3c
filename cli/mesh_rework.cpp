// SPDX-License-Identifier: Apache-2.0
#include "cli/mesh_rework.h"

#include <cmath>
#include <string>

#include "cli/quantities.h"
#include "core/error.h"
#include "export/mesh_simplify.h"
#include "export/mesh_smooth.h"

namespace nerfvdb {
namespace {

/// The default rule gives way to any that is asked for.
IslandOptions islandRules(const ReworkWords& words) {
    const bool has_other_rule = words.keep_islands || words.keep_largest > 0 || words.min_faces > 0;
    return {.keep_largest = words.keep_largest,
            .min_faces = words.min_faces,
            .min_share = words.min_share.value_or(has_other_rule ? 0 : kCrumbShare)};
}

std::size_t wantedFaces(const Mesh& mesh, const ReworkWords& words) {
    if (words.faces) return static_cast<std::size_t>(*words.faces);
    const double share = words.simplify.value_or(1) * static_cast<double>(mesh.triangles.size());
    return std::max(kFewestFaces, static_cast<std::size_t>(std::llround(share)));
}

void simplify(Mesh& mesh, std::size_t n_faces, Report& report) {
    simplifyMesh(mesh, n_faces);
    constexpr double kNoticeable = 1.02;
    if (static_cast<double>(mesh.triangles.size()) > kNoticeable * static_cast<double>(n_faces))
        report.warn("mesh: " + std::to_string(mesh.triangles.size()) + " faces are left of " + std::to_string(n_faces) +
                    " wanted: the shape allows no fewer");
}

}  // namespace

void addRework(CLI::App& app, ReworkWords& words) {
    CLI::Option* share = app.add_option("--min-share", words.min_share,
                                        "Drop pieces with fewer triangles than this share of the largest piece's "
                                        "[0.005; 0 with --keep-largest or --min-faces]")
                             ->check(CLI::Range(0.0, 1.0))
                             ->type_name("SHARE");
    CLI::Option* largest = app.add_option("--keep-largest", words.keep_largest, "Keep the N largest pieces only")
                               ->check(positive())
                               ->type_name("N");
    CLI::Option* fewest = app.add_option("--min-faces", words.min_faces, "Drop pieces of fewer triangles")
                              ->check(positive())
                              ->type_name("N");
    CLI::Option* keep = app.add_flag("--keep-islands", words.keep_islands, "Keep every piece, crumbs too");
    for (CLI::Option* rule : {share, largest, fewest}) keep->excludes(rule);
    app.add_option("--smooth", words.smooth,
                   "Rounds of smoothing that keep the volume (Taubin's); 10 to 30 take terraces off [0]")
        ->check(CLI::Range(0, 1000))
        ->type_name("N");
    CLI::Option* ratio =
        app.add_option("--simplify", words.simplify, "Collapse edges until this share of the triangles is left")
            ->check(CLI::Range(0.0, 1.0))
            ->type_name("RATIO");
    app.add_option("--faces", words.faces, "Collapse edges until N triangles are left")
        ->type_name("N")
        ->excludes(ratio);
}

void checkRework(const ReworkWords& words) {
    if (words.simplify && *words.simplify <= 0)
        throw UsageError("--simplify", std::to_string(*words.simplify), "a share of the triangles above 0");
    if (words.faces && *words.faces < static_cast<std::int64_t>(kFewestFaces))
        throw NumericError("--faces", std::to_string(*words.faces), "at least " + std::to_string(kFewestFaces),
                           "no closed surface has fewer triangles");
}

bool asksForWork(const ReworkWords& words) {
    return words.min_share || words.keep_largest || words.min_faces || words.smooth || words.simplify || words.faces;
}

IslandCounts reworkMesh(Mesh& mesh, const ReworkWords& words, Report& report) {
    IslandOptions rules = islandRules(words);
    IslandCounts islands = removeIslands(mesh, rules);
    if (words.smooth > 0) smoothMesh(mesh, words.smooth);
    const std::size_t n_faces = wantedFaces(mesh, words);
    if (n_faces >= mesh.triangles.size()) return islands;
    simplify(mesh, n_faces, report);
    // Where a body is thin, collapsing edges parts it; triangles are now larger than those that min_faces counts.
    rules.min_faces = 0;
    const IslandCounts parted = removeIslands(mesh, rules);
    islands.kept_pieces = parted.kept_pieces;
    islands.largest_faces = parted.largest_faces;
    islands.dropped_pieces += parted.dropped_pieces;
    islands.dropped_faces += parted.dropped_faces;
    return islands;
}

}  // namespace nerfvdb
