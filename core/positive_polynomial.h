// SPDX-License-Identifier: Apache-2.0
// Whether a polynomial is positive all along an interval, without looking for its roots.
#pragma once

#include <array>
#include <cstddef>

namespace nerfvdb {

/// True if c[0] + c[1] u + ... + c[N-1] u^(N-1) > 0 for all u in [0, end]. One that touches zero, or is not finite,
/// is not positive.
///
/// In Bernstein's basis a polynomial lies within the hull of its coefficients, whose first and last are its values at
/// the ends; where the hull does not decide, halves of the interval do (de Casteljau).
template <std::size_t N>
bool isPositiveUpTo(const std::array<double, N>& c, double end) {
    // c[i] end^i as Bernstein coefficients: b_j = sum_{i <= j} C(j, i) / C(N - 1, i) a_i.
    std::array<double, N> b{};
    double power = 1, choose_n = 1;
    for (std::size_t i = 0; i < N; ++i) {
        const double a = c[i] == 0 ? 0 : c[i] * power / choose_n;
        double choose_j = 1;
        for (std::size_t j = i; j < N; ++j) {
            b[j] += choose_j * a;
            choose_j *= static_cast<double>(j + 1) / static_cast<double>(j + 1 - i);
        }
        power *= end;
        choose_n *= static_cast<double>(N - 1 - i) / static_cast<double>(i + 1);
    }

    const auto isPositive = [](const auto& self, const std::array<double, N>& right, int halvings) -> bool {
        if (!(right[0] > 0 && right[N - 1] > 0)) return false;
        bool all = true;
        for (const double value : right) all = all && value > 0;
        if (all) return true;
        if (halvings == 0) return false;  // as good as touching zero
        std::array<double, N> left{}, rest = right;
        for (std::size_t k = 0; k < N; ++k) {
            left[k] = rest[0];
            for (std::size_t j = 0; j + 1 + k < N; ++j) rest[j] = 0.5 * (rest[j] + rest[j + 1]);
        }
        // `rest` holds the last of each row by now: the right half.
        return self(self, left, halvings - 1) && self(self, rest, halvings - 1);
    };
    return isPositive(isPositive, b, 40);
}

}  // namespace nerfvdb
