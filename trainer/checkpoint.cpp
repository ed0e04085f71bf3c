// SPDX-License-Identifier: Apache-2.0
#include "trainer/checkpoint.h"

#include <unistd.h>

#include <algorithm>
#include <bit>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <limits>
#include <string>
#include <type_traits>
#include <utility>

#include "core/atomic_file.h"
#include "core/error.h"
#include "core/file_descriptor.h"
#include "core/parallel.h"
#include "vdb/layer_cells.h"

namespace nerfvdb {
namespace {

static_assert(std::endian::native == std::endian::little, "checkpoints are little-endian");

constexpr std::string_view kHead = "nerfvdb-checkpoint 4\n";
constexpr std::size_t kHashDigits = 32;
constexpr std::size_t kPieceBytes = std::size_t{1} << 20;  // written or read at once

/// Visits fields by handing their bytes on: sink.append(bytes).
template <typename Sink>
class Writer {
public:
    static constexpr bool kIsReading = false;
    explicit Writer(Sink& sink) : sink_(sink) {}
    template <typename T>
    void value(const T& v) {
        static_assert(std::is_trivially_copyable_v<T>);
        sink_.append(std::as_bytes(std::span(&v, 1)));
    }
    template <typename Array>  // std::vector or std::string
    void values(const Array& v) {
        value(static_cast<std::uint64_t>(v.size()));
        sink_.append(std::as_bytes(std::span(v.data(), v.size())));
    }

private:
    Sink& sink_;
};

/// Counts bytes.
struct ByteCount {
    std::size_t size = 0;
    void append(std::span<const std::byte> bytes) { size += bytes.size(); }
};

/// Fills memory.
struct MemorySink {
    static constexpr std::size_t kGroupLeaves = std::numeric_limits<std::size_t>::max();
    std::byte* next;
    void append(std::span<const std::byte> bytes) { std::copy(bytes.begin(), bytes.end(), room(bytes.size())); }
    std::byte* room(std::size_t size) { return std::exchange(next, next + size); }
};

/// Fills a file, all but its head, and hashes it on the way; memory holds no more than a piece.
class FileSink {
public:
    static constexpr std::size_t kGroupLeaves = 256;  // 4 MiB of eight channels
    explicit FileSink(const AppendBytes& append) : append_(append) {}
    void append(std::span<const std::byte> bytes) { std::copy(bytes.begin(), bytes.end(), room(bytes.size())); }
    /// The file's next bytes, to be filled before the next call.
    std::byte* room(std::size_t size) {
        if (piece_.size() >= kPieceBytes) flush();
        piece_.resize(piece_.size() + size);
        return piece_.data() + piece_.size() - size;
    }
    std::string finish() {
        flush();
        return hash_.digits();
    }

private:
    void flush() {
        hash_.add(piece_);
        append_(piece_);
        piece_.clear();
    }
    const AppendBytes& append_;
    std::vector<std::byte> piece_;
    ContentHash hash_;
};

/// Visits fields by reading them from a file in pieces.
class Reader {
public:
    static constexpr bool kIsReading = true;
    /// From the file's position on, `left` bytes.
    Reader(const PlainFile& file, std::size_t left, const std::filesystem::path& path)
        : file_(file), left_(left), path_(path) {}
    template <typename T>
    void value(T& v) {
        if constexpr (std::is_same_v<T, bool>) {
            std::uint8_t byte = 0;  // a bool of another byte than 0 and 1 is undefined
            value(byte);
            v = byte != 0;
        } else {
            read(std::as_writable_bytes(std::span(&v, 1)));
        }
    }
    template <typename Array>
    void values(Array& v) {
        std::uint64_t n = 0;
        value(n);
        if (n > left_ / sizeof v[0]) fail();
        v.resize(n);
        read(std::as_writable_bytes(std::span(v.data(), v.size())));
    }
    void read(std::span<std::byte> to) {
        if (to.size() > left_) fail();
        left_ -= to.size();
        while (!to.empty()) {
            if (next_ == piece_.size()) fill();
            const std::size_t n = std::min(to.size(), piece_.size() - next_);
            std::memcpy(to.data(), &piece_[next_], n);
            next_ += n;
            to = to.subspan(n);
        }
    }
    void finish() const {
        if (left_ > 0) fail();
    }
    [[noreturn]] void fail() const {
        throw DataError(path_.string(), "fields that do not fit each other or its length",
                        "a checkpoint of this version", "train without --resume");
    }

private:
    void fill() {
        piece_.resize(kPieceBytes);
        piece_.resize(readAll(file_.get(), piece_, path_));
        next_ = 0;
        if (piece_.empty()) fail();  // someone cuts the file short while it is read
    }
    const PlainFile& file_;
    std::size_t left_;
    const std::filesystem::path& path_;
    std::vector<std::byte> piece_;
    std::size_t next_ = 0;
};

/// A pool without its gaps is a row of the voxels that exist. Calls use(voxels, copy) for groups of at most `n_leaves`
/// leaves, in order: `voxels` says how many they have, and copy(move) calls move(position in the pool, position in the
/// group's row) for each, in parallel.
template <typename Use>
void forEachGroup(const Topology& topology, std::size_t n_leaves, const Use& use) {
    const std::span<const LeafMask> masks = topology.voxels();
    for (std::size_t first = 0; first < masks.size(); first += n_leaves) {
        const std::span<const LeafMask> group = masks.subspan(first, std::min(n_leaves, masks.size() - first));
        std::vector<std::size_t> begin{0};
        for (const LeafMask& mask : group) {
            std::size_t n = 0;
            for (const std::uint64_t word : mask) n += static_cast<std::size_t>(std::popcount(word));
            begin.push_back(begin.back() + n);
        }
        use(begin.back(), [&](const auto& move) {
            parallelRanges(group.size(), 32, [&](std::size_t from, std::size_t to) {
                for (std::size_t leaf = from; leaf < to; ++leaf) {
                    std::size_t next = begin[leaf];
                    forEachBit(group[leaf], [&](int offset) { move((first + leaf) * kLeafVoxels + offset, next++); });
                }
            });
        });
    }
}

template <typename Sink>
void writePool(Sink& sink, const Topology& topology, int channels, std::span<const float> pool) {
    Writer(sink).value(static_cast<std::uint64_t>(topology.voxelCount() * channels));
    const std::size_t bytes = channels * sizeof(float);
    forEachGroup(topology, Sink::kGroupLeaves, [&](std::size_t voxels, const auto& copy) {
        std::byte* const room = sink.room(voxels * bytes);
        copy([&](std::size_t from, std::size_t to) { std::memcpy(room + to * bytes, &pool[from * channels], bytes); });
    });
}

void readPool(Reader& reader, const Topology& topology, int channels, std::span<float> pool) {
    std::uint64_t n = 0;
    reader.value(n);
    if (n != topology.voxelCount() * channels) reader.fail();
    std::vector<float> values;
    forEachGroup(topology, FileSink::kGroupLeaves, [&](std::size_t voxels, const auto& copy) {
        values.resize(voxels * channels);
        reader.read(std::as_writable_bytes(std::span(values)));
        copy([&](std::size_t to, std::size_t from) {
            std::copy_n(&values[from * channels], channels, &pool[to * channels]);
        });
    });
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
    auto flags = static_cast<std::uint8_t>((place.tries_exposure ? 1 : 0) + (place.has_asked_voxels ? 2 : 0));
    visit.value(flags);
    place.tries_exposure = flags & 1;
    place.has_asked_voxels = flags & 2;
}

/// The grid and everything small that belongs to the state.
struct GridFields {
    Vec3i dims;
    Vec3d origin;
    Shells shells;
    Vec3i regions = Vec3i::Zero();
    std::vector<std::uint8_t> halvings;
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
    // Regions are told of only where there are some: what knows none is as it was before there were any.
    constexpr int kWithRegions = 1 << 16;
    int count = grid.shells.count + (grid.halvings.empty() ? 0 : kWithRegions);
    visit.value(count);
    grid.shells.count = count % kWithRegions;
    visitVector(visit, grid.shells.extent);
    visit.value(grid.shells.stride);
    if (count >= kWithRegions) {
        visitVector(visit, grid.regions);
        visit.values(grid.halvings);
    }
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

std::size_t skyValueCount(std::int64_t width) {
    return width > 0 ? static_cast<std::size_t>(width * (width / 2) * 3) : 0;
}

template <typename Visitor>
void visitSky(Visitor& visit, Sky& sky) {
    int width = sky.width();
    visit.value(width);
    std::vector<float> values(sky.values().begin(), sky.values().end());
    visit.values(values);
    if constexpr (Visitor::kIsReading) {
        // Not before the values are known to be there.
        if (values.size() != skyValueCount(width)) visit.fail();
        sky = width > 0 ? Sky(width, Vec3f::Zero()) : Sky();
        std::copy(values.begin(), values.end(), sky.values().begin());
    }
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
    visit.value(state.behind);
    visit.value(state.distortion);
}

bool isSound(const TrainPlace& place) {
    const auto isSoundStage = [](const Stage& stage) {
        return stage.level >= 0 && stage.level < kMostLevels && stage.batch > 0 && stage.steps >= 0 &&
               std::isfinite(stage.share);
    };
    return place.stage < place.stages.size() && std::all_of(place.stages.begin(), place.stages.end(), isSoundStage) &&
           place.step >= 0 && place.step_in_stage >= 0 && place.next_occupancy >= 0 && place.n_views >= 0 &&
           std::isfinite(place.mean_error);
}

bool isSound(const GridFields& grid) {
    constexpr int kMaxDims = 1 << 20;
    const auto isPositive = [](double value) { return value > 0 && std::isfinite(value); };
    return (grid.dims.array() >= kLeafDim).all() && (grid.dims.array() <= kMaxDims).all() && grid.origin.allFinite() &&
           (grid.shells.count == 1 ? grid.halvings.empty() : grid.shells.fits(grid.dims)) &&
           (grid.halvings.empty() || grid.shells.regions) && isPositive(grid.voxel_size) &&
           isPositive(grid.density_scale) && (grid.channels == 4 || grid.channels == 8 || grid.channels == 16) &&
           grid.decoder_width >= 1 && grid.decoder_width <= kMaxDecoderWidth && grid.leaves.size() == grid.cells.size();
}

/// All but the pools.
template <typename Sink>
void writeSmall(Sink& sink, const TrainState& state, const TrainPlace& place) {
    const Topology& topology = state.field.topology();
    Writer writer(sink);
    TrainPlace place_copy = place;
    visitPlace(writer, place_copy);
    const Regions* const regions = state.field.shells().regions.get();
    GridFields grid{topology.dims(), state.field.frame().origin, state.field.shells(),
                    regions ? regions->dims : Vec3i::Zero(), regions ? regions->halvings : std::vector<std::uint8_t>{},
                    state.field.frame().voxel_size, state.field.densityScale(), state.field.channels(),
                    state.decoder.width(), {topology.leafCoords().begin(), topology.leafCoords().end()},
                    {topology.cells().begin(), topology.cells().end()}};
    visitGrid(writer, grid);
    std::vector<float> network(state.decoder.parameters().begin(), state.decoder.parameters().end());
    visitLearner(writer, const_cast<TrainState&>(state), network);  // a writer changes nothing
}

template <typename Sink>
void writePools(Sink& sink, const TrainState& state) {
    const Topology& topology = state.field.topology();
    writePool(sink, topology, 1, state.field.density());
    writePool(sink, topology, state.field.channels(), state.field.features());
    writePool(sink, topology, 1, state.density_moment.span());
    writePool(sink, topology, 1, state.feature_moment.span());
}

std::string headWith(const std::string& hash) { return std::string(kHead) + hash + "\n"; }

/// Where the file's body begins, behind a head that has been found good and a body that has its hash.
std::size_t verifiedBody(const PlainFile& file, std::size_t size, const std::filesystem::path& path) {
    std::string head(kHead.size() + kHashDigits + 1, '\0');
    head.resize(readAll(file.get(), std::as_writable_bytes(std::span(head)), path));
    if (!head.starts_with(kHead.substr(0, kHead.size() - 2)))
        throw DataError(path.string(), "another kind of file", "a nerfvdb checkpoint", "train without --resume");
    if (!head.starts_with(kHead))
        throw DataError(path.string(), "a checkpoint of another version", "version 4", "train without --resume");
    ContentHash hash;
    std::vector<std::byte> piece(kPieceBytes);
    std::size_t left = size - std::min(size, head.size());
    while (left > 0) {
        const std::size_t n = readAll(file.get(), std::span(piece).first(std::min(left, piece.size())), path);
        if (n == 0) break;
        hash.add(std::span(piece).first(n));
        left -= n;
    }
    if (left > 0 || head != headWith(hash.digits()))
        throw DataError(path.string(), "a damaged or truncated checkpoint", "contents that match its checksum",
                        "train without --resume");
    return head.size();
}

}  // namespace

std::size_t checkpointBytes(const TrainState& state, const TrainPlace& place) {
    ByteCount count;
    writeSmall(count, state, place);
    const std::size_t values = state.field.topology().voxelCount() * (state.field.channels() + 3);
    return count.size + values * sizeof(float) + 4 * sizeof(std::uint64_t);
}

PackedCheckpoint packCheckpoint(const TrainState& state, const TrainPlace& place) {
    PackedCheckpoint packed;
    packed.size = checkpointBytes(state, place);
    packed.bytes = std::make_unique_for_overwrite<std::byte[]>(packed.size);
    MemorySink sink{packed.bytes.get()};
    writeSmall(sink, state, place);
    writePools(sink, state);
    return packed;
}

void saveCheckpoint(const std::filesystem::path& path, const PackedCheckpoint& packed) {
    const auto write = [&](const AppendBytes& append) {
        const std::span<const std::byte> body(packed.bytes.get(), packed.size);
        const std::string head = headWith(contentHash(body));
        append(std::as_bytes(std::span(head)));
        append(body);
        return head;
    };
    writePieces(path, write, Durable::system);
}

void saveCheckpoint(const std::filesystem::path& path, const TrainState& state, const TrainPlace& place) {
    const auto write = [&](const AppendBytes& append) {
        const std::string room = headWith(std::string(kHashDigits, '0'));
        append(std::as_bytes(std::span(room)));
        FileSink sink(append);
        writeSmall(sink, state, place);
        writePools(sink, state);
        return headWith(sink.finish());
    };
    writePieces(path, write, Durable::system);
}

void loadCheckpoint(const std::filesystem::path& path, TrainState& state, TrainPlace& place,
                    const std::function<void()>& check) {
    const PlainFile file(path);
    const std::size_t size = file.size();
    const std::size_t begin = verifiedBody(file, size, path);
    if (::lseek(file.get(), static_cast<off_t>(begin), SEEK_SET) < 0) throwErrno(path, errno, "a plain file");

    Reader reader(file, size - begin, path);
    visitPlace(reader, place);
    GridFields grid;
    visitGrid(reader, grid);
    if (!grid.halvings.empty()) grid.shells.regions = makeRegions(grid.shells.count, grid.regions, grid.halvings);
    if (!isSound(place) || !isSound(grid)) reader.fail();
    std::vector<Topology::LeafCells> leaves;
    for (std::size_t leaf = 0; leaf < grid.leaves.size(); ++leaf)
        leaves.push_back({grid.leaves[leaf], grid.cells[leaf]});
    GridFrame frame;
    frame.origin = grid.origin;
    frame.voxel_size = grid.voxel_size;
    state.field = VoxelField(Topology(grid.dims, leaves), frame, grid.shells, grid.channels, grid.density_scale);
    if (!strayLeaf(state.field.topology(), grid.shells).empty()) reader.fail();
    state.decoder = Decoder(grid.channels, place.seed, grid.decoder_width);
    std::vector<float> network;
    visitLearner(reader, state, network);
    const Topology& topology = state.field.topology();
    state.density_moment = HugeArray<float>(state.field.density().size());
    state.feature_moment = HugeArray<float>(state.field.density().size());
    const auto isFor = [](const Adam& adam, std::size_t n) {
        return adam.count >= 0 && adam.first.size() == adam.second.size() && (adam.first.empty() || adam.first.size() == n);
    };
    if (state.behind > Behind::plain || !isFor(state.network, network.size()) ||
        !isFor(state.sky_optimizer, state.sky.values().size()) ||
        (state.exposures.learned() && state.exposures.viewCount() != static_cast<std::size_t>(place.n_views)) ||
        network.size() != state.decoder.parameters().size() || state.seen.size() != topology.leafCount() ||
        state.occupancy.cells.size() != topology.leafCount())
        reader.fail();
    std::copy(network.begin(), network.end(), state.decoder.parameters().begin());
    check();
    readPool(reader, topology, 1, state.field.density());
    readPool(reader, topology, grid.channels, state.field.features());
    readPool(reader, topology, 1, state.density_moment.span());
    readPool(reader, topology, 1, state.feature_moment.span());
    reader.finish();
    state.occupancy = occupancyFromCells(topology, std::move(state.occupancy.cells));
}

}  // namespace nerfvdb
