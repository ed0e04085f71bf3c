// SPDX-License-Identifier: Apache-2.0
// Layout: a table of chunk sizes, then chunks of 256 leaves, each coded by itself (in parallel). Masks are coded
// bit by bit, each in the context of its neighbours; values as integers that a neighbour predicts where that pays.
#include "vdb/field_codec.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>

#include "core/error.h"
#include "core/parallel.h"
#include "core/range_coder.h"

namespace nerfvdb {
namespace {

constexpr std::size_t kChunkLeaves = 256;

std::size_t chunkCount(std::size_t leaves) { return (leaves + kChunkLeaves - 1) / kChunkLeaves; }

// ---- Chunks ----

void appendU32(std::string& out, std::size_t value) {
    if (value > 0xffffffffu)
        throw DataError("model", std::to_string(value) + " bytes in one part", "at most 4 GiB",
                        "the scene is too large for one model file: train with --max-memory or smaller --bounds");
    for (int shift = 0; shift < 32; shift += 8) out.push_back(static_cast<char>(value >> shift & 0xff));
}

std::uint32_t readU32(const std::uint8_t* bytes) {
    return bytes[0] | bytes[1] << 8 | bytes[2] << 16 | static_cast<std::uint32_t>(bytes[3]) << 24;
}

/// Codes every chunk of leaves by code(first, last, out) and joins the results.
template <typename Code>
std::string encodeChunks(std::size_t leaves, const Code& code) {
    std::vector<std::string> chunks(chunkCount(leaves));
    parallelFor(chunks.size(), [&](std::size_t c) {
        RangeEncoder out;
        code(c * kChunkLeaves, std::min(leaves, (c + 1) * kChunkLeaves), out);
        chunks[c] = out.finish();
    });
    std::string bytes;
    appendU32(bytes, leaves);
    for (const std::string& chunk : chunks) appendU32(bytes, chunk.size());
    for (std::string& chunk : chunks) {
        bytes += chunk;
        std::string().swap(chunk);
    }
    return bytes;
}

std::size_t leavesInChunks(std::span<const std::uint8_t> bytes, const std::string& where) {
    if (bytes.size() < 4) throw DataError(where, std::to_string(bytes.size()) + " bytes", "a count of leaves");
    return readU32(bytes.data());
}

/// The mirror: decode(first, last, in) for every chunk. The sizes are checked before anything is read.
template <typename Decode>
void decodeChunks(std::span<const std::uint8_t> bytes, std::size_t leaves, const std::string& where,
                  const Decode& decode) {
    const std::size_t count = chunkCount(leaves);
    if (leavesInChunks(bytes, where) != leaves)
        throw DataError(where, std::to_string(leavesInChunks(bytes, where)) + " leaves",
                        std::to_string(leaves) + " as in the topology");
    if ((bytes.size() - 4) / 4 < count)
        throw DataError(where, std::to_string(bytes.size()) + " bytes",
                        "a table of " + std::to_string(count) + " chunks");
    std::vector<std::size_t> begin(count + 1, 4 + 4 * count);
    for (std::size_t c = 0; c < count; ++c) begin[c + 1] = begin[c] + readU32(&bytes[4 + 4 * c]);
    if (begin[count] != bytes.size())
        throw DataError(where, std::to_string(bytes.size()) + " bytes", std::to_string(begin[count]));
    parallelFor(count, [&](std::size_t c) {
        RangeDecoder in(bytes.subspan(begin[c], begin[c + 1] - begin[c]));
        decode(c * kChunkLeaves, std::min(leaves, (c + 1) * kChunkLeaves), in);
        if (!in.atEnd())
            throw DataError(where, "chunk " + std::to_string(c) + " of another length", "the one that was coded");
    });
}

// ---- Topology ----

/// Bits of a mask, each in the context of its three lower neighbours inside the leaf.
struct MaskModel {
    std::array<BitModel, 8> contexts;

    BitModel& at(const LeafMask& mask, int offset) {
        int context = 0;
        if (offset & 7) context |= testBit(mask, offset - 1);
        if (offset >> 3 & 7) context |= testBit(mask, offset - 8) << 1;
        if (offset >> 6) context |= testBit(mask, offset - 64) << 2;
        return contexts[context];
    }
};

bool isEmpty(const LeafMask& mask) {
    return std::all_of(mask.begin(), mask.end(), [](std::uint64_t word) { return word == 0; });
}

// ---- Values ----

/// What a voxel's code is likely near: the mean of its lower neighbours in the leaf, else the last voxel's.
int predict(const int* codes, const LeafMask& mask, int offset, int last) {
    int sum = 0, count = 0;
    const auto add = [&](bool inside, int step) {
        if (inside && testBit(mask, offset - step)) sum += codes[offset - step], ++count;
    };
    add(offset & 7, 1);
    add(offset >> 3 & 7, 8);
    add(offset >> 6, 64);
    return count ? sum / count : last;
}

/// Codes one channel of a chunk; `codes` [leaf][512]. Prediction pays for smooth channels and costs for noise:
/// whichever leaves the smaller sum of magnitudes is taken, and said in one bit.
void encodeChannel(std::span<const LeafMask> masks, const int* codes, RangeEncoder& out) {
    const auto residuals = [&](bool predicted, const auto& visit) {
        int last = 0;
        for (std::size_t leaf = 0; leaf < masks.size(); ++leaf) {
            const int* leaf_codes = codes + leaf * kLeafVoxels;
            forEachBit(masks[leaf], [&](int offset) {
                const int base = predicted ? predict(leaf_codes, masks[leaf], offset, last) : 0;
                last = leaf_codes[offset];
                visit(last - base);
            });
        }
    };
    std::int64_t plain_sum = 0, predicted_sum = 0;
    residuals(false, [&](int residual) { plain_sum += std::abs(residual); });
    residuals(true, [&](int residual) { predicted_sum += std::abs(residual); });
    const bool predicted = predicted_sum < plain_sum;
    out.raw(predicted, 1);
    IntegerModel model;
    residuals(predicted, [&](int residual) { model.encode(out, residual); });
}

void decodeChannel(std::span<const LeafMask> masks, int* codes, RangeDecoder& in) {
    const bool predicted = in.raw(1);
    IntegerModel model;
    int last = 0;
    for (std::size_t leaf = 0; leaf < masks.size(); ++leaf) {
        int* leaf_codes = codes + leaf * kLeafVoxels;
        forEachBit(masks[leaf], [&](int offset) {
            const int base = predicted ? predict(leaf_codes, masks[leaf], offset, last) : 0;
            const std::int64_t code = std::int64_t{base} + model.decode(in);
            last = static_cast<int>(std::clamp<std::int64_t>(code, -kMaxCode, kMaxCode));  // wrong bytes stay tame
            leaf_codes[offset] = last;
        });
    }
}

}  // namespace

std::string encodeTopology(const Topology& topology) {
    // Leaves without a cell follow from the others: they hold upper corners only.
    std::vector<std::size_t> with_cells;
    for (std::size_t leaf = 0; leaf < topology.leafCount(); ++leaf)
        if (!isEmpty(topology.cells()[leaf])) with_cells.push_back(leaf);
    return encodeChunks(with_cells.size(), [&](std::size_t first, std::size_t last, RangeEncoder& out) {
        std::array<IntegerModel, 3> coord_models;
        MaskModel mask_model;
        Vec3i previous = Vec3i::Zero();
        for (std::size_t i = first; i < last; ++i) {
            const Vec3i& coord = topology.leafCoords()[with_cells[i]];
            for (int axis = 0; axis < 3; ++axis) coord_models[axis].encode(out, coord[axis] - previous[axis]);
            previous = coord;
            const LeafMask& mask = topology.cells()[with_cells[i]];
            for (int offset = 0; offset < kLeafVoxels; ++offset)
                out.bit(testBit(mask, offset), mask_model.at(mask, offset));
        }
    });
}

Topology decodeTopology(const Vec3i& dims, std::span<const std::uint8_t> bytes, const std::string& where) {
    const std::size_t leaves = leavesInChunks(bytes, where);
    // A leaf's 512 bits cost 1.6 bits at the very least (BitModel); more cannot be true and must not be allocated.
    if (leaves / 8 > bytes.size()) throw DataError(where, std::to_string(leaves) + " leaves", "as many as bytes allow");
    std::vector<Topology::LeafCells> cells(leaves);
    decodeChunks(bytes, leaves, where, [&](std::size_t first, std::size_t last, RangeDecoder& in) {
        std::array<IntegerModel, 3> coord_models;
        MaskModel mask_model;
        Vec3i coord = Vec3i::Zero();
        for (std::size_t i = first; i < last; ++i) {
            if (in.ranDry()) throw DataError(where, "a chunk that ends before its leaves", "the one that was coded");
            for (int axis = 0; axis < 3; ++axis) {
                const std::int64_t next = std::int64_t{coord[axis]} + coord_models[axis].decode(in);
                if (next < 0 || next >= dims[axis] / kLeafDim)
                    throw DataError(where, "a leaf at " + std::to_string(next),
                                    "0 to " + std::to_string(dims[axis] / kLeafDim - 1));
                coord[axis] = static_cast<int>(next);
            }
            cells[i] = {coord, {}};
            for (int offset = 0; offset < kLeafVoxels; ++offset)
                if (in.bit(mask_model.at(cells[i].cells, offset))) setBit(cells[i].cells, offset);
        }
    });
    try {
        return Topology(dims, cells);
    } catch (const Error& error) {
        throw DataError(where, std::string("cells that do not fit (") + error.what() + ")", "cells inside the box");
    }
}

std::string encodeValues(const VoxelField& field, const StepExponents& steps) {
    std::string bytes;
    for (const int exponent : steps) bytes.push_back(static_cast<char>(static_cast<std::int8_t>(exponent)));
    const std::span<const LeafMask> masks = field.topology().voxels();
    bytes += encodeChunks(masks.size(), [&](std::size_t first, std::size_t last, RangeEncoder& out) {
        std::vector<int> codes((last - first) * kLeafVoxels);
        for (int k = 0; k <= field.channels(); ++k) {
            for (std::size_t leaf = first; leaf < last; ++leaf)
                forEachBit(masks[leaf], [&](int offset) {
                    codes[(leaf - first) * kLeafVoxels + offset] =
                        codeOf(keptValue(field, leaf * kLeafVoxels + offset, k), steps[k]);
                });
            encodeChannel(masks.subspan(first, last - first), codes.data(), out);
        }
    });
    return bytes;
}

void decodeValues(std::span<const std::uint8_t> bytes, const std::string& where, VoxelField& field) {
    const auto channels = static_cast<std::size_t>(field.channels());
    if (bytes.size() < channels + 1)
        throw DataError(where, std::to_string(bytes.size()) + " bytes", "a step for each channel");
    StepExponents steps(channels + 1);
    for (std::size_t k = 0; k <= channels; ++k) steps[k] = static_cast<std::int8_t>(bytes[k]);
    const std::span<const LeafMask> masks = field.topology().voxels();
    const std::span<float> density = field.density(), features = field.features();
    decodeChunks(bytes.subspan(channels + 1), masks.size(), where,
                 [&](std::size_t first, std::size_t last, RangeDecoder& in) {
                     std::vector<int> codes((last - first) * kLeafVoxels);
                     bool fits = true;
                     for (std::size_t k = 0; k <= channels; ++k) {
                         decodeChannel(masks.subspan(first, last - first), codes.data(), in);
                         for (std::size_t leaf = first; leaf < last; ++leaf)
                             forEachBit(masks[leaf], [&](int offset) {
                                 const std::size_t voxel = leaf * kLeafVoxels + offset;
                                 const float value = valueOf(codes[(leaf - first) * kLeafVoxels + offset], steps[k]);
                                 fits &= canBeStored(value);
                                 if (k == 0) density[voxel] = value;
                                 else features[voxel * channels + (k - 1)] = value;
                             });
                     }
                     if (!fits) throw DataError(where, "a value of more than a million", "values as training makes them");
                 });
}

}  // namespace nerfvdb
