// SPDX-License-Identifier: Apache-2.0
#include "core/spherical_harmonics.h"

#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "tests/support/catch.h"

using namespace nerfvdb;

namespace {

std::array<float, kSphericalHarmonics> harmonicsAt(double x, double y, double z) {
    std::array<float, kSphericalHarmonics> values;
    sphericalHarmonics(static_cast<float>(x), static_cast<float>(y), static_cast<float>(z), values.data());
    return values;
}

}  // namespace

TEST_CASE("spherical harmonics are orthonormal over the sphere") {
    // Exact quadrature for products of two degree-3 polynomials: 4 Gauss-Legendre nodes in z (degree 7), 8
    // equal steps of azimuth (frequencies below 8).
    constexpr double kNode[2] = {0.3399810435848563, 0.8611363115940526};
    constexpr double kWeight[2] = {0.6521451548625461, 0.3478548451374538};
    double product[kSphericalHarmonics][kSphericalHarmonics] = {};
    for (int i = 0; i < 4; ++i)
        for (int j = 0; j < 8; ++j) {
            const double z = (i & 1 ? -1 : 1) * kNode[i / 2], azimuth = 2 * std::numbers::pi * (j + 0.3) / 8;
            const double radius = std::sqrt(1 - z * z);
            const auto y = harmonicsAt(radius * std::cos(azimuth), radius * std::sin(azimuth), z);
            for (int a = 0; a < kSphericalHarmonics; ++a)
                for (int b = 0; b < kSphericalHarmonics; ++b)
                    product[a][b] += kWeight[i / 2] * 2 * std::numbers::pi / 8 * y[a] * y[b];
        }
    for (int a = 0; a < kSphericalHarmonics; ++a)
        for (int b = 0; b < kSphericalHarmonics; ++b)
            CHECK(product[a][b] == Approx(a == b ? 1 : 0).margin(1e-6));  // 32 products of single precision
}

TEST_CASE("spherical harmonics of degree l are even or odd as l is, and written with any stride") {
    const auto here = harmonicsAt(0.48, -0.6, 0.64), there = harmonicsAt(-0.48, 0.6, -0.64);
    std::vector<float> spread(kSphericalHarmonics * 5, -7.0f);
    sphericalHarmonics(0.48f, -0.6f, 0.64f, spread.data(), 5);
    for (int k = 0; k < kSphericalHarmonics; ++k) {
        const int degree = static_cast<int>(std::sqrt(k));
        CHECK(there[k] == (degree % 2 ? -here[k] : here[k]));
        CHECK(spread[5 * k] == here[k]);
        CHECK(spread[5 * k + 1] == -7.0f);
    }
}

TEST_CASE("spherical harmonics have Sloan's order and signs") {
    const auto x = harmonicsAt(1, 0, 0), y = harmonicsAt(0, 1, 0), z = harmonicsAt(0, 0, 1);
    CHECK((x[3] < 0 && y[1] < 0 && z[2] > 0));                           // l = 1: -y, z, -x
    CHECK((z[6] > 0 && x[8] > 0 && y[8] < 0));                           // 3 z^2 - 1, x^2 - y^2
    CHECK(z[12] == Approx(0.25 * std::sqrt(7 / std::numbers::pi) * 2));  // z (5 z^2 - 3) at the pole
}
