// SPDX-License-Identifier: Apache-2.0
// The surface of a model as triangles: marching cubes over the sparse leaves, in parallel.
#pragma once

#include <optional>
#include <span>

#include "core/report.h"
#include "export/mesh.h"
#include "vdb/model.h"

namespace nerfvdb {

enum class SurfaceMethod { marching_cubes, dual };

struct MeshOptions {
    /// Extinction at the surface, 1 / world unit, positive. Absent: automaticIso.
    std::optional<double> iso;
    bool colours = true;  // ask the model for a colour per vertex; costs one network evaluation each
    /// Bodies become solid: no surface where the outside does not reach (see fill_inside.h).
    bool fill_inside = false;
    /// Only what is inside of this box, world units: the surface closes at the voxel planes nearest to its
    /// faces.
    std::optional<Box> bounds = {};
    /// Leaves out the triangles that do nothing but close the surface: at `bounds`, and where the known region ends.
    bool open = false;
    /// Voxels along the longest side of the field's box (of the box, not of `bounds`: tiles share one lattice),
    /// at most kMostResolution: the surface is extracted from the field resampled to them (resample_field.h).
    /// 0: its own.
    int resolution = 0;
    /// What extractSurface promises holds for marching cubes; for the other see dual_mesh.h.
    SurfaceMethod method = SurfaceMethod::marching_cubes;
    double adaptivity = 0;  // of the dual method, in [0, 1]
};

inline constexpr int kMostResolution = 8192;

/// The largest extinction of an active voxel, 1 / world unit. Infinite and absurd densities are left to extractSurface.
double largestSigma(const VoxelField& field);

/// The extinction that stops half of the light over one voxel: ln 2 / voxel_size, in 1 / world unit. Fog may
/// nowhere be so dense: the surface is where it has half of its largest density, if that is less.
double automaticIso(const VoxelField& field);

/// The iso-surface of the density, closed (unless MeshOptions::open), with outward normals and diffuse colours.
///
/// The surface is where the raw density, before its activation, crosses ln(iso / density_scale): the same
/// surface as that of sigma, but raw values are what the field interpolates, so that crossings are exact. The
/// field is taken on all of space: a voxel that is not active (Topology::voxels) holds kEmptyRaw. So the
/// surface closes by itself at the border of what is known and at the box. What has been filled is cut by
/// `bounds`, not filled within them.
///
/// Holds: every edge has exactly two triangles, in opposite directions, and around every vertex they form
///        one ring (closed, oriented, manifold); no triangle is degenerate; why: see marching_cubes_table.h.
///        Ambiguous faces follow the bilinear field on them (asymptotic decider); tunnels through the inside of
///        one cube are not made.
/// Tiles: boxes that adjoin in a voxel plane have, in that plane, the same vertices with the same normals. All
///        triangles but those that close the boxes, 2^-10 voxels beyond, are those of the whole surface, each
///        in one tile. So a surface of which even the list of blocks is too large (streamSurface) can be made
///        box by box and joined by position.
/// Cost:  time and memory follow the active leaves; beyond the mesh itself, some 300 bytes per leaf.
/// Threads: the mesh is the same, byte for byte, for any number of threads.
/// Errors: UsageError (iso not positive or below that of an empty voxel; bounds without a voxel; resolution or
///        adaptivity out of range; open with the dual method), NumericError (no voxel, or only empty ones; iso above
///        the field's maximum; nothing inside the bounds, left at the resolution, or not at the border, if open;
///        non-finite density; too many vertices), Interrupted.
Mesh extractSurface(const Model& model, const MeshOptions& options, Report& report);

/// Takes a mesh part by part: all vertices in order, then all triangles in order.
class MeshSink {
public:
    virtual ~MeshSink() = default;
    virtual void begin(std::size_t vertices, std::size_t triangles) = 0;
    virtual void addVertices(const Mesh& part) = 0;  // the next ones; no triangles
    virtual void addTriangles(std::span<const Triangle> part) = 0;
};

/// The mesh of extractSurface, for surfaces larger than memory: beyond the field some 400 bytes a leaf and 30
/// MB for the part in hand. Throws as extractSurface does, for the dual method and open surfaces UsageError, and what
/// the sink throws.
void streamSurface(const Model& model, const MeshOptions& options, MeshSink& sink, Report& report);

}  // namespace nerfvdb
