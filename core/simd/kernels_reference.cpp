// SPDX-License-Identifier: Apache-2.0
// The scalar truth of kernels.h.
#include <algorithm>
#include <cmath>
#include <vector>

#include "core/simd/kernels.h"

namespace nerfvdb::reference {
namespace {

float cornerWeight(float fx, float fy, float fz, int corner) {
    return (corner & 4 ? fx : 1 - fx) * (corner & 2 ? fy : 1 - fy) * (corner & 1 ? fz : 1 - fz);
}

float trilinearDensity(const Bricks& bricks, const SampleArrays& samples, int i) {
    float sum = 0;
    for (int corner = 0; corner < 8; ++corner)
        sum += cornerWeight(samples.x[i], samples.y[i], samples.z[i], corner) *
               bricks.density[cornerIndex(bricks, samples.leaf[i], samples.cell[i], corner)];
    return sum;
}

}  // namespace

int marchRays(const Bricks& bricks, const RayTile& rays, float step, int max_per_ray, const std::int32_t* alive,
              int n_alive, std::int32_t* begin, const SampleArrays& out) {
    int n = 0;
    for (int a = 0; a < n_alive; ++a) {
        begin[a] = n;
        const int r = alive[a];
        std::int32_t k = rays.next[r], visited = -1, k_end = 0;
        for (; k >= 0; ++k) {
            const float t = std::fma(static_cast<float>(k), step, rays.offset[r]);
            if (!(t < rays.length[r])) {
                k = -1;
                break;
            }
            const float p[3] = {std::fma(rays.dx[r], t, rays.ox[r]), std::fma(rays.dy[r], t, rays.oy[r]),
                                std::fma(rays.dz[r], t, rays.oz[r])};
            int leaf_coord[3], cell[3];
            float fraction[3];
            for (int axis = 0; axis < 3; ++axis) {
                leaf_coord[axis] = std::clamp(static_cast<int>(p[axis]) >> 3, 0, bricks.leaf_dims[axis] - 1);
                const float local = p[axis] - static_cast<float>(leaf_coord[axis] * 8);
                cell[axis] = std::clamp(static_cast<int>(local), 0, 7);
                fraction[axis] = std::clamp(local - static_cast<float>(cell[axis]), 0.0f, 1.0f);
            }
            const std::int32_t node =
                bricks.skip_nodes[(static_cast<std::size_t>(leaf_coord[0] / 8) * bricks.node_dims[1] +
                                   leaf_coord[1] / 8) * bricks.node_dims[2] + leaf_coord[2] / 8];
            const std::int32_t leaf =
                node < 0 ? node
                         : bricks.skip_leaves[node * std::size_t{512} + (leaf_coord[0] % 8) * 64 +
                                              (leaf_coord[1] % 8) * 8 + leaf_coord[2] % 8];
            if (visited < 0 && leaf >= 0) visited = leaf, k_end = k + max_per_ray;
            if (visited >= 0 && (leaf != visited || k == k_end)) break;
            if (leaf < 0) continue;
            const int bit = cell[1] * 8 + cell[2];
            if (!(bricks.occupied[leaf * std::size_t{8} + cell[0]] >> bit & 1)) continue;
            out.leaf[n] = leaf;
            out.cell[n] = cell[0] * 64 + bit;
            out.x[n] = fraction[0];
            out.y[n] = fraction[1];
            out.z[n] = fraction[2];
            out.t[n] = t;
            ++n;
        }
        rays.next[r] = k;
    }
    begin[n_alive] = n;
    return n;
}

void densityForward(const Bricks& bricks, int n, const SampleArrays& samples, float max_raw, float tau_scale,
                    float* raw, float* tau, float* alpha, float* decay) {
    for (int i = n; i < n + kPadding; ++i) samples.leaf[i] = samples.cell[i] = 0;
    for (int i = 0; i < n; ++i) {
        raw[i] = trilinearDensity(bricks, samples, i);
        tau[i] = std::exp(std::min(raw[i], max_raw)) * tau_scale;
        alpha[i] = -std::expm1(-tau[i]);
        decay[i] = std::exp(-tau[i]);
    }
}

void sigmaForward(const Bricks& bricks, int n, const SampleArrays& samples, float tau_scale, float* tau, float* alpha,
                  float* decay) {
    for (int i = n; i < n + kPadding; ++i) samples.leaf[i] = samples.cell[i] = 0;
    for (int i = 0; i < n; ++i) {
        tau[i] = trilinearDensity(bricks, samples, i) * tau_scale;
        alpha[i] = -std::expm1(-tau[i]);
        decay[i] = std::exp(-tau[i]);
    }
}

void featuresForward(const Bricks& bricks, int n, const SampleArrays& samples, const std::int32_t* ray,
                     const float* weight, float* features, float* ray_features) {
    const int channels = bricks.channels;
    for (int i = n; i < n + kPadding; ++i) samples.leaf[i] = samples.cell[i] = 0;
    for (int i = 0; i < n; ++i)
        for (int c = 0; c < channels; ++c) {
            float sum = 0;
            for (int corner = 0; corner < 8; ++corner)
                sum += cornerWeight(samples.x[i], samples.y[i], samples.z[i], corner) *
                       bricks.features[cornerIndex(bricks, samples.leaf[i], samples.cell[i], corner) * channels + c];
            features[static_cast<std::size_t>(i) * channels + c] = sum;
            ray_features[static_cast<std::size_t>(ray[i]) * channels + c] += weight[i] * sum;
        }
}

void rowDots(int n, int channels, const float* features, const std::int32_t* ray, const float* ray_features,
             float* out) {
    for (int i = 0; i < n; ++i) {
        float sum = 0;
        for (int c = 0; c < channels; ++c)
            sum += features[static_cast<std::size_t>(i) * channels + c] *
                   ray_features[static_cast<std::size_t>(ray[i]) * channels + c];
        out[i] = sum;
    }
}

void accumulateLeaf(int n, const LeafContribution* contributions, int channels, const LeafGradient& gradient) {
    for (int i = 0; i < n; ++i) {
        const SampleGradient& sample = *contributions[i].sample;
        // The cell relative to this leaf: -1 if it lies in a lower neighbour, and only its upper corners here.
        const std::uint32_t from = contributions[i].corner;
        const int cell_x = (sample.cell >> 6) - (from & 4 ? 8 : 0), cell_y = (sample.cell >> 3 & 7) - (from & 2 ? 8 : 0),
                  cell_z = (sample.cell & 7) - (from & 1 ? 8 : 0);
        for (int corner = 0; corner < 8; ++corner) {
            const int x = cell_x + (corner >> 2 & 1), y = cell_y + (corner >> 1 & 1), z = cell_z + (corner & 1);
            if (x < 0 || x > 7 || y < 0 || y > 7 || z < 0 || z > 7) continue;
            const int voxel = x * 64 + y * 8 + z;
            const float corner_weight = cornerWeight(sample.x, sample.y, sample.z, corner);
            gradient.density[voxel] += corner_weight * sample.dl_draw;
            for (int c = 0; c < channels; ++c)
                gradient.features[voxel * channels + c] += corner_weight * sample.weight * sample.dl_dfeatures[c];
            gradient.touched[x] |= std::uint64_t{1} << (y * 8 + z);
        }
    }
}

void prefetchLeaf(int, const RmsPropRates&, const std::uint64_t*, const LeafGradient&, const float*, const float*,
                  const float*, const float*) {}

void rmsPropLeaf(int channels, const RmsPropRates& rates, const std::uint64_t* active, const LeafGradient& gradient,
                 float* density, float* density_moment, float* features, float* feature_moment) {
    for (int voxel = 0; voxel < 512; ++voxel) {
        if (!(gradient.touched[voxel >> 6] >> (voxel & 63) & 1)) continue;
        const float g = gradient.density[voxel];
        density_moment[voxel] = rates.decay * density_moment[voxel] + (1 - rates.decay) * g * g;
        std::vector<int> neighbours;
        for (const int stride : {64, 8, 1})
            for (const int side : {-1, 1}) {
                const int position = voxel / stride % 8 + side;
                const int neighbour = voxel + side * stride;
                if (position >= 0 && position < 8 && (active[neighbour >> 6] >> (neighbour & 63) & 1))
                    neighbours.push_back(neighbour);
            }
        // How far a value stands above the mean of its neighbours'.
        const auto roughness = [&](const float* values, int stride) {
            if (neighbours.empty()) return 0.0f;
            float sum = 0;
            for (const int neighbour : neighbours) sum += values[neighbour * stride];
            return values[voxel * stride] - sum / static_cast<float>(neighbours.size());
        };
        density[voxel] -= rates.density_rate *
                          (g / (std::sqrt(density_moment[voxel]) + rates.epsilon) + rates.sparsity +
                           rates.density_smoothing * std::clamp(roughness(density, 1), -1.0f, 1.0f));
        gradient.density[voxel] = 0;

        float squares = 0;
        for (int c = 0; c < channels; ++c) {
            const float gf = gradient.features[voxel * channels + c];
            squares += gf * gf;
        }
        feature_moment[voxel] =
            rates.decay * feature_moment[voxel] + (1 - rates.decay) * squares / static_cast<float>(channels);
        const float scale = rates.feature_rate / (std::sqrt(feature_moment[voxel]) + rates.epsilon);
        for (int c = 0; c < channels; ++c) {
            features[voxel * channels + c] -=
                scale * gradient.features[voxel * channels + c] +
                rates.feature_rate * rates.feature_smoothing * roughness(features + c, channels);
            gradient.features[voxel * channels + c] = 0;
        }
    }
    for (int word = 0; word < 8; ++word) gradient.touched[word] = 0;
}

void layerForward(int n, int stride, int n_in, int n_out, const float* weights, const float* bias, bool relu,
                  const float* in, float* out) {
    const int padded = (n + kPadding - 1) / kPadding * kPadding;
    for (int o = 0; o < n_out; ++o)
        for (int b = 0; b < padded; ++b) {
            float sum = bias[o];
            for (int i = 0; i < n_in; ++i) sum += weights[o * n_in + i] * in[i * stride + b];
            out[o * stride + b] = relu ? std::max(sum, 0.0f) : sum;
        }
}

void layerBackwardInput(int n, int stride, int n_in, int n_out, const float* weights, const float* dl_dout,
                        const float* relu_of, float* dl_din) {
    const int padded = (n + kPadding - 1) / kPadding * kPadding;
    for (int i = 0; i < n_in; ++i)
        for (int b = 0; b < padded; ++b) {
            float sum = 0;
            for (int o = 0; o < n_out; ++o) sum += weights[o * n_in + i] * dl_dout[o * stride + b];
            dl_din[i * stride + b] = relu_of && !(relu_of[i * stride + b] > 0) ? 0.0f : sum;
        }
}

void layerBackwardWeights(int n, int stride, int n_in, int n_out, const float* dl_dout, const float* in,
                          float* dl_dweights, float* dl_dbias) {
    for (int o = 0; o < n_out; ++o) {
        for (int i = 0; i < n_in; ++i) {
            float sum = 0;
            for (int b = 0; b < n; ++b) sum += dl_dout[o * stride + b] * in[i * stride + b];
            dl_dweights[o * n_in + i] += sum;
        }
        float sum = 0;
        for (int b = 0; b < n; ++b) sum += dl_dout[o * stride + b];
        dl_dbias[o] += sum;
    }
}

void adamStep(int n, const AdamRates& rates, const float* gradients, float* first, float* second, float* parameters) {
    for (int i = 0; i < n; ++i) {
        first[i] = rates.beta1 * first[i] + (1 - rates.beta1) * gradients[i];
        second[i] = rates.beta2 * second[i] + (1 - rates.beta2) * gradients[i] * gradients[i];
        parameters[i] -= rates.rate * rates.scale1 * first[i] / (std::sqrt(rates.scale2 * second[i]) + rates.epsilon);
    }
}

double multiplyAdds(int rounds, float start, float* end) {
    constexpr int kRegisters = 12;
    float x[kRegisters];
    for (float& value : x) value = start;
    for (int round = 0; round < rounds; ++round)
        for (float& value : x) value = 0.5f * value + 0.5f;
    for (int i = 0; i < kPadding; ++i) end[i] = 0;
    for (const float value : x) end[0] += value;
    return 2.0 * rounds * kRegisters;
}

}  // namespace nerfvdb::reference
