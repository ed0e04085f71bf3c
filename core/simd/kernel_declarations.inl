// SPDX-License-Identifier: Apache-2.0
// Included by kernels.h, once per namespace.

/// Walks each of the rays named in `alive` to its next leaf with occupied cells, and through that leaf for at most
/// `max_per_ray` steps. Samples of alive[a], those in occupied cells, are [begin[a], begin[a + 1]) in order along
/// the ray; there may be none. Where the ray is to go on stands in next, -1 if it has ended. Empty leaves are
/// jumped by the distances in skip_nodes and skip_leaves, empty cells are tested by bit. Needs length / step of at
/// most 2^24. Returns the number of samples; `out` must hold n_alive * max_per_ray.
int marchRays(const Bricks& bricks, const RayTile& rays, float step, int max_per_ray,
              const std::int32_t* alive, int n_alive, std::int32_t* begin, const SampleArrays& out);

/// Trilinear raw density and what it does to light over one sample:
///   tau = exp(min(raw, max_raw)) * tau_scale,  alpha = 1 - exp(-tau) (by expm1),  decay = exp(-tau)
/// d tau / d raw = tau everywhere (the clamp keeps its slope). Sets the padding of samples.leaf and .cell to 0.
void densityForward(const Bricks& bricks, int n, const SampleArrays& samples, float max_raw, float tau_scale,
                    float* raw, float* tau, float* alpha, float* decay);

/// The same where the bricks hold sigma itself, nowhere negative: tau = sigma * tau_scale.
void sigmaForward(const Bricks& bricks, int n, const SampleArrays& samples, float tau_scale, float* tau, float* alpha,
                  float* decay);

/// f_i = trilinear features of sample i; F[ray_i] += weight_i f_i.
/// Shapes: features [n][channels], ray_features [rays][channels]. Sets the padding as densityForward.
void featuresForward(const Bricks& bricks, int n, const SampleArrays& samples, const std::int32_t* ray,
                     const float* weight, float* features, float* ray_features);

/// out[i] = dot(features[i], ray_features[ray[i]]), both rows of `channels` floats.
void rowDots(int n, int channels, const float* features, const std::int32_t* ray, const float* ray_features,
             float* out);

/// Adjoint of the trilinear reads, for one leaf: adds every contribution to the corners that lie in the leaf.
///   density gradient += corner_weight * dl_draw,  feature gradient += corner_weight * weight * dl_dfeatures
void accumulateLeaf(int n, const LeafContribution* contributions, int channels, const LeafGradient& gradient);

/// RMSprop on the touched voxels of one leaf, one second moment per voxel for all its features:
///   m = decay m + (1 - decay) mean(g^2),  u = g / (sqrt(m) + epsilon)
///   density  -= density_rate (u + sparsity + density_smoothing clamp(density - mean of the face neighbours, -1, 1))
///   features -= feature_rate (u + feature_smoothing (features - mean of the face neighbours))
/// Neighbours are those in the same leaf whose bit in `active` [8] is set; voxels are done in order, so that some
/// are new already. The pulls stand beside u, not in g: whatever the gradients' size, they stay small against a
/// step that samples agree on, and decide where samples do not.
/// Source: Tieleman and Hinton 2012, lecture 6.5; lazy: untouched voxels keep their moments; pulls decoupled as in
/// Loshchilov and Hutter 2019, "Decoupled weight decay regularization". Clears the gradient.
/// Shapes: density, density_moment, feature_moment [512], features [512][channels].
void rmsPropLeaf(int channels, const RmsPropRates& rates, const std::uint64_t* active, const LeafGradient& gradient,
                 float* density, float* density_moment, float* features, float* feature_moment);

/// Asks for the memory that rmsPropLeaf is going to read, without waiting for it. Changes nothing.
void prefetchLeaf(int channels, const RmsPropRates& rates, const std::uint64_t* active, const LeafGradient& gradient,
                  const float* density, const float* density_moment, const float* features,
                  const float* feature_moment);

/// out[o][b] = bias[o] + sum_i weights[o][i] in[i][b], through ReLU if asked. Rows are `stride` floats apart;
/// b runs to n rounded up to kPadding.
void layerForward(int n, int stride, int n_in, int n_out, const float* weights, const float* bias, bool relu,
                  const float* in, float* out);

/// dl_din[i][b] = sum_o weights[o][i] dl_dout[o][b]; where `relu_of` is given, zero where relu_of[i][b] <= 0.
void layerBackwardInput(int n, int stride, int n_in, int n_out, const float* weights, const float* dl_dout,
                        const float* relu_of, float* dl_din);

/// dl_dweights[o][i] += sum_b dl_dout[o][b] in[i][b];  dl_dbias[o] += sum_b dl_dout[o][b].
/// dl_dout must be zero from n up to the next multiple of kPadding.
void layerBackwardWeights(int n, int stride, int n_in, int n_out, const float* dl_dout, const float* in,
                          float* dl_dweights, float* dl_dbias);

/// Adam (Kingma and Ba 2015, algorithm 1) on n parameters; any n, no padding needed.
///   m = beta1 m + (1 - beta1) g,  v = beta2 v + (1 - beta2) g^2
///   parameter -= rate scale1 m / (sqrt(scale2 v) + epsilon)
void adamStep(int n, const AdamRates& rates, const float* gradients, float* first, float* second, float* parameters);

/// A yardstick, for benchmarks: x = x / 2 + 1 / 2 again and again, `rounds` times in each of twelve registers, as fast as
/// this instruction set multiplies and adds. Returns the operations done, two for each lane of each register and round;
/// end [kPadding], zero from the lanes on, takes a sum over the registers that began at `start`: 12 after many rounds.
double multiplyAdds(int rounds, float start, float* end);
