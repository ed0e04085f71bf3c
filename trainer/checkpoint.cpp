// SPDX-License-Identifier: Apache-2.0
#include "trainer/checkpoint.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <string>
#include <type_traits>

#include "core/atomic_file.h"
#include "core/error.h"
#include "core/parallel.h"

namespace nerfvdb {
namespace {

static_assert(std::endian::native == std::endian::little, "checkpoints are little-endian");

constexpr std::string_view kHead = "nerfvdb-checkpoint 4\n";
constexpr std::size_t kHashDigits = 32;

/// Visits fields by appending them to a string.
class Writer {
public:
    static constexpr bool kIsReading = false;
    explicit Writer(std::string& out) : out_(out) {}
    template <typename T>
    void value(const T& v) {
        static_assert(std::is_trivially_copyable_v<T>);
        out_.append(reinterpret_cast<const char*>(&v), sizeof v);
    }
    template <typename Array>  // std::vector or std::string
    void values(Array& v) {
        value(static_cast<std::uint64_t>(v.size()));
        out_.append(reinterpret_cast<const char*>(v.data()), v.size() * sizeof v[0]);
    }

private:
    std::string& out_;
};

/// Visits fields by taking them from bytes.
class Reader {
public:
    static constexpr bool kIsReading = true;
    Reader(std::string_view bytes, std::string where) : bytes_(bytes), where_(std::move(where)) {}
    template <typename T>
    void value(T& v) {
        std::memcpy(&v, take(sizeof v), sizeof v);
    }
    template <typename Array>
    void values(Array& v) {
        std::uint64_t n = 0;
        value(n);
        if (n > bytes_.size() / sizeof v[0]) fail();
        v.resize(n);
        if (n) std::memcpy(v.data(), take(n * sizeof v[0]), n * sizeof v[0]);
    }
    void finish() const {
        if (!bytes_.empty()) fail();
    }

private:
    const char* take(std::size_t n) {
        if (n > bytes_.size()) fail();
        const char* const data = bytes_.data();
        bytes_.remove_prefix(n);
        return data;
    }
    [[noreturn]] void fail() const {
        throw DataError(where_, "fields that do not fit its length", "a checkpoint of this version",
                        "train without --resume");
    }
    std::string_view bytes_;
    std::string where_;
};

/// Where each leaf's values begin in a pool without its gaps, in voxels; [leaves + 1].
std::vector<std::size_t> compactOffsets(const Topology& topology) {
    std::vector<std::size_t> begin{0};
    for (const LeafMask& mask : topology.voxels()) {
        std::size_t n = 0;
        for (const std::uint64_t word : mask) n += static_cast<std::size_t>(std::popcount(word));
        begin.push_back(begin.back() + n);
    }
    return begin;
}

/// Calls move(pool position, compact position) for every voxel that exists, in parallel.
template <typename Move>
void forEachVoxel(const Topology& topology, const std::vector<std::size_t>& begin, const Move& move) {
    parallelRanges(topology.leafCount(), 64, [&](std::size_t first, std::size_t last) {
        for (std::size_t leaf = first; leaf < last; ++leaf) {
            std::size_t next = begin[leaf];
            forEachBit(topology.voxels()[leaf], [&](int offset) { move(leaf * kLeafVoxels + offset, next++); });
        }
    });
}

std::vector<float> gather(const Topology& topology, int channels, std::span<const float> pool) {
    const std::vector<std::size_t> begin = compactOffsets(topology);
    std::vector<float> values(begin.back() * channels);
    forEachVoxel(topology, begin, [&](std::size_t from, std::size_t to) {
        std::copy_n(&pool[from * channels], channels, &values[to * channels]);
    });
    return values;
}

bool scatter(const Topology& topology, int channels, const std::vector<float>& values, std::span<float> pool) {
    const std::vector<std::size_t> begin = compactOffsets(topology);
    if (values.size() != begin.back() * channels) return false;
    forEachVoxel(topology, begin, [&](std::size_t to, std::size_t from) {
        std::copy_n(&values[from * channels], channels, &pool[to * channels]);
    });
    return true;
}

/// The small fields, in file order; the same function writes and reads, so the two cannot disagree.
template <typename Visitor>
void visitPlace(Visitor& visit, TrainPlace& place) {
    std::vector<Stage>& stages = place.stages;
    visit.values(stages);
    visit.value(place.stage);
    visit.value(place.step);
    visit.value(place.step_in_stage);
    visit.value(place.next_occupancy);
    visit.value(place.rays);
    visit.value(place.mean_error);
    visit.value(place.seed);
    visit.value(place.n_views);
    visit.values(place.data_hash);
    visit.value(place.tries_exposure);
}

/// The grid and everything small that belongs to the state.
struct GridFields {
    Vec3i dims;
    Vec3d origin;
    Shells shells;
    double voxel_size, density_scale;
    int channels, decoder_width;
    std::vector<Vec3i> leaves;
    std::vector<LeafMask> cells;
};

template <typename Visitor, typename T, int kRows>
void visitVector(Visitor& visit, Eigen::Matrix<T, kRows, 1>& v) {
    for (int i = 0; i < kRows; ++i) visit.value(v[i]);
}

template <typename Visitor>
void visitGrid(Visitor& visit, GridFields& grid) {
    visitVector(visit, grid.dims);
    visitVector(visit, grid.origin);
    visit.value(grid.shells.count);
    visitVector(visit, grid.shells.extent);
    visit.value(grid.shells.stride);
    visit.value(grid.voxel_size);
    visit.value(grid.density_scale);
    visit.value(grid.channels);
    visit.value(grid.decoder_width);
    std::vector<std::array<std::int32_t, 3>> leaves;
    for (const Vec3i& leaf : grid.leaves) leaves.push_back({leaf.x(), leaf.y(), leaf.z()});
    visit.values(leaves);
    if constexpr (Visitor::kIsReading) {
        grid.leaves.clear();
        for (const auto& leaf : leaves) grid.leaves.emplace_back(leaf[0], leaf[1], leaf[2]);
    }
    visit.values(grid.cells);
}

template <typename Visitor>
void visitSky(Visitor& visit, Sky& sky) {
    int width = sky.width();
    visit.value(width);
    if constexpr (Visitor::kIsReading) sky = width > 0 ? Sky(width, Vec3f::Zero()) : Sky();
    std::vector<float> values(sky.values().begin(), sky.values().end());
    visit.values(values);
    if (values.size() == sky.values().size()) std::copy(values.begin(), values.end(), sky.values().begin());
}

template <typename Visitor>
void visitLearner(Visitor& visit, TrainState& state, std::vector<float>& network) {
    visit.values(network);
    visit.values(state.network.first);
    visit.values(state.network.second);
    visit.value(state.network.count);
    state.exposures.visit(visit);
    visit.values(state.occupancy.cells);
    visit.values(state.seen);
    visit.value(state.min_seen);
    visitVector(visit, state.background);
    visitSky(visit, state.sky);
    visit.values(state.sky_optimizer.first);
    visit.values(state.sky_optimizer.second);
    visit.value(state.sky_optimizer.count);
    visit.value(state.random_background);
    visit.value(state.distortion);
}

}  // namespace

void saveCheckpoint(const std::filesystem::path& path, const TrainState& state, const TrainPlace& place) {
    const Topology& topology = state.field.topology();
    const int channels = state.field.channels();
    std::string body(kHead);
    body.append(kHashDigits, '0').append("\n");
    body.reserve(topology.voxelCount() * (channels + 3) * sizeof(float) + topology.bytes() + (1 << 20));
    Writer writer(body);
    TrainPlace place_copy = place;
    visitPlace(writer, place_copy);
    GridFields grid{topology.dims(), state.field.frame().origin, state.field.shells(),
                    state.field.frame().voxel_size, state.field.densityScale(), channels, state.decoder.width(),
                    {topology.leafCoords().begin(), topology.leafCoords().end()},
                    {topology.cells().begin(), topology.cells().end()}};
    visitGrid(writer, grid);
    std::vector<float> network(state.decoder.parameters().begin(), state.decoder.parameters().end());
    visitLearner(writer, const_cast<TrainState&>(state), network);  // a writer changes nothing
    const auto add = [&](int n_channels, std::span<const float> pool) {
        std::vector<float> values = gather(topology, n_channels, pool);
        writer.values(values);
    };
    add(1, state.field.density());
    add(channels, state.field.features());
    add(1, state.density_moment.span());
    add(1, state.feature_moment.span());

    const std::size_t head = kHead.size() + kHashDigits + 1;
    const std::string hash = contentHash(std::as_bytes(std::span(body).subspan(head)));
    body.replace(kHead.size(), kHashDigits, hash);
    writeAtomically(path, body, Durable::system);
}

void loadCheckpoint(const std::filesystem::path& path, TrainState& state, TrainPlace& place) {
    const std::string file = readFile(path);
    const std::string_view bytes(file);
    if (!bytes.starts_with(kHead.substr(0, kHead.size() - 2)))
        throw DataError(path.string(), "another kind of file", "a nerfvdb checkpoint", "train without --resume");
    if (!bytes.starts_with(kHead))
        throw DataError(path.string(), "a checkpoint of another version", "version 4", "train without --resume");
    const std::size_t begin = kHead.size() + kHashDigits + 1;
    if (bytes.size() < begin ||
        contentHash(std::as_bytes(std::span(bytes.substr(begin)))) != bytes.substr(kHead.size(), kHashDigits))
        throw DataError(path.string(), "a damaged or truncated checkpoint", "contents that match its checksum",
                        "train without --resume");

    Reader reader(bytes.substr(begin), path.string());
    visitPlace(reader, place);
    GridFields grid;
    visitGrid(reader, grid);
    std::vector<Topology::LeafCells> leaves;
    for (std::size_t leaf = 0; leaf < grid.leaves.size(); ++leaf)
        leaves.push_back({grid.leaves[leaf], grid.cells[leaf]});
    GridFrame frame;
    frame.origin = grid.origin;
    frame.voxel_size = grid.voxel_size;
    state.field = VoxelField(Topology(grid.dims, leaves), frame, grid.shells, grid.channels, grid.density_scale);
    state.decoder = Decoder(grid.channels, place.seed, grid.decoder_width);
    std::vector<float> network;
    visitLearner(reader, state, network);
    const Topology& topology = state.field.topology();
    state.density_moment = HugeArray<float>(state.field.density().size());
    state.feature_moment = HugeArray<float>(state.field.density().size());
    bool fits = (!state.exposures.learned() || state.exposures.viewCount() == static_cast<std::size_t>(place.n_views)) &&
                network.size() == state.decoder.parameters().size() && state.seen.size() == topology.leafCount() &&
                state.occupancy.cells.size() == topology.leafCount();
    if (fits) std::copy(network.begin(), network.end(), state.decoder.parameters().begin());
    std::vector<float> values;
    const auto next = [&](int channels, std::span<float> pool) {
        reader.values(values);
        fits = fits && scatter(topology, channels, values, pool);
    };
    next(1, state.field.density());
    next(grid.channels, state.field.features());
    next(1, state.density_moment.span());
    next(1, state.feature_moment.span());
    reader.finish();
    if (!fits)
        throw DataError(path.string(), "fields of sizes that do not fit each other", "a checkpoint of this version",
                        "train without --resume");
    state.occupancy = occupancyFromCells(topology, std::move(state.occupancy.cells));
}

}  // namespace nerfvdb
