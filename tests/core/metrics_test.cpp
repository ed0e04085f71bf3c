// SPDX-License-Identifier: Apache-2.0
#include "core/metrics.h"

#include <cmath>
#include <limits>

#include "core/error.h"
#include "core/parallel.h"
#include "core/random.h"
#include "tests/support/catch.h"

using namespace nerfvdb;

namespace {

Image noise(int width, int height, std::uint64_t seed) {
    Image image(width, height, 3);
    for (std::size_t i = 0; i < image.pixels.size(); ++i)
        image.pixels[i] = unitFloat(static_cast<std::uint32_t>(randomBits(seed, 0, i)));
    return image;
}

Image constant(int width, int height, float value) {
    Image image(width, height, 3);
    std::fill(image.pixels.begin(), image.pixels.end(), value);
    return image;
}

/// Wang et al. 2004 straight from the definition: for each window the weighted mean, then the weighted central
/// moments about it, with the two-dimensional Gaussian.
double slowSsim(const Image& a, const Image& b) {
    double weights[11][11], total = 0;
    for (int y = 0; y < 11; ++y)
        for (int x = 0; x < 11; ++x) {
            weights[y][x] = std::exp(-((x - 5) * (x - 5) + (y - 5) * (y - 5)) / (2 * 1.5 * 1.5));
            total += weights[y][x];
        }
    double sum = 0;
    int count = 0;
    for (int y0 = 0; y0 + 11 <= a.height; ++y0)
        for (int x0 = 0; x0 + 11 <= a.width; ++x0)
            for (int c = 0; c < 3; ++c) {
                double mean_a = 0, mean_b = 0, var_a = 0, var_b = 0, cov = 0;
                for (int y = 0; y < 11; ++y)
                    for (int x = 0; x < 11; ++x) {
                        mean_a += weights[y][x] / total * a.at(x0 + x, y0 + y)[c];
                        mean_b += weights[y][x] / total * b.at(x0 + x, y0 + y)[c];
                    }
                for (int y = 0; y < 11; ++y)
                    for (int x = 0; x < 11; ++x) {
                        const double da = a.at(x0 + x, y0 + y)[c] - mean_a,
                                     db = b.at(x0 + x, y0 + y)[c] - mean_b;
                        var_a += weights[y][x] / total * da * da;
                        var_b += weights[y][x] / total * db * db;
                        cov += weights[y][x] / total * da * db;
                    }
                const double c1 = 1e-4, c2 = 9e-4;
                const double luminance = (2 * mean_a * mean_b + c1) / (mean_a * mean_a + mean_b * mean_b + c1);
                sum += luminance * (2 * cov + c2) / (var_a + var_b + c2);
                ++count;
            }
    return sum / count;
}

}  // namespace

TEST_CASE("PSNR of known errors", "[core]") {
    CHECK(psnrFromMse(0.01) == Approx(20));
    CHECK(psnrFromMse(1) == Approx(0).margin(1e-12));
    CHECK(psnrFromMse(0) == 100);
    CHECK(psnrFromMse(1e-20) == 100);  // below what 100 dB says: means stay comparable
    CHECK(std::isnan(psnrFromMse(std::numeric_limits<double>::quiet_NaN())));
    // A difference of 0.1 everywhere: mse 0.01, up to float's 0.1.
    CHECK(psnr(constant(20, 10, 0.5f), constant(20, 10, 0.6f)) == Approx(20).epsilon(1e-6));
    const Image image = noise(33, 17, 1);
    CHECK(psnr(image, image) == 100);

    Image one_pixel = image;
    one_pixel.at(4, 5)[1] += 0.25f;
    CHECK(meanSquaredError(image, one_pixel) ==
          Approx(0.0625 / (33 * 17 * 3)).epsilon(1e-5));  // float sum 0.25
}

TEST_CASE("SSIM of known pictures", "[core]") {
    const Image image = noise(40, 30, 1);
    CHECK(ssim(image, image) == 1.0);
    // Constant pictures have no variance: what remains is (2 a b + C1) / (a^2 + b^2 + C1).
    CHECK(ssim(constant(16, 16, 0.25f), constant(16, 16, 0.75f)) ==
          Approx((2 * 0.25 * 0.75 + 1e-4) / (0.0625 + 0.5625 + 1e-4)).epsilon(1e-12));
    CHECK(ssim(constant(16, 16, 0.0f), constant(16, 16, 1.0f)) == Approx(1e-4 / (1 + 1e-4)).epsilon(1e-12));

    // One bright pixel in the middle of one window: its weight is w = g(0)^2, mean w, variance w - w^2; against
    // black the covariance is 0. g(0) = 1 / sum_k exp(-k^2 / 4.5), k = -5..5.
    double sum = 0;
    for (int k = -5; k <= 5; ++k) sum += std::exp(-k * k / 4.5);
    const double w = 1 / (sum * sum);
    Image dot = constant(11, 11, 0.0f);
    for (int c = 0; c < 3; ++c) dot.at(5, 5)[c] = 1.0f;
    CHECK(ssim(dot, constant(11, 11, 0.0f)) ==
          Approx(1e-4 / (w * w + 1e-4) * 9e-4 / (w - w * w + 9e-4)).epsilon(1e-10));
}

TEST_CASE("SSIM equals the slow definition", "[core]") {
    const int width = GENERATE(11, 12, 37), height = GENERATE(11, 29);
    const Image a = noise(width, height, 1), other = noise(width, height, 2);
    Image b = a;
    for (std::size_t i = 0; i < b.pixels.size(); ++i) b.pixels[i] = 0.7f * a.pixels[i] + 0.3f * other.pixels[i];
    // Both in double; E[x^2] - E[x]^2 loses three digits at most against C2 = 9e-4.
    CHECK(ssim(a, b) == Approx(slowSsim(a, b)).epsilon(1e-11));
    CHECK(ssim(a, other) == Approx(slowSsim(a, other)).epsilon(1e-11).margin(1e-11));
    CHECK(ssim(a, b) == Approx(ssim(b, a)).epsilon(1e-14));
}

TEST_CASE("metrics do not depend on the number of threads", "[core]") {
    const Image a = noise(100, 90, 1), b = noise(100, 90, 2);
    double one_ssim, one_mse;
    {
        const ThreadLimit limit(1);
        one_ssim = ssim(a, b);
        one_mse = meanSquaredError(a, b);
    }
    CHECK(ssim(a, b) == one_ssim);
    CHECK(meanSquaredError(a, b) == one_mse);
}

TEST_CASE("metrics refuse pictures that cannot be compared", "[core]") {
    CHECK_THROWS_AS(psnr(noise(10, 20, 1), noise(20, 10, 1)), UsageError);
    CHECK_THROWS_AS(meanSquaredError(Image(), Image()), UsageError);
    CHECK_THROWS_AS(ssim(noise(10, 20, 1), noise(10, 20, 2)), UsageError);
    CHECK_THROWS_AS(ssim(noise(12, 20, 1), Image(12, 20, 1)), UsageError);
    // Not a number in, not a number out: a mean over views must not hide it.
    Image bad = noise(16, 16, 1);
    bad.pixels[100] = std::numeric_limits<float>::quiet_NaN();
    CHECK(std::isnan(psnr(bad, noise(16, 16, 1))));
    CHECK(std::isnan(ssim(bad, noise(16, 16, 1))));
}

TEST_CASE("a mask leaves its pixels out of the error, and the windows that hold them out of the similarity") {
    const int width = 40, height = 30;
    Image a(width, height, 3), b(width, height, 3);
    for (std::size_t i = 0; i < a.pixels.size(); ++i) {
        a.pixels[i] = static_cast<float>((i * 37) % 101) / 100.0f;
        b.pixels[i] = static_cast<float>((i * 59) % 103) / 102.0f;
    }
    // What counts is the picture's part [8, 36) x [5, 27): the metrics are those of this part alone.
    PixelMask mask(width, height), all(width, height);
    Image part_a(28, 22, 3), part_b(28, 22, 3);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            all.keep(x, y);
            if (x < 8 || x >= 36 || y < 5 || y >= 27) continue;
            mask.keep(x, y);
            for (int c = 0; c < 3; ++c) {
                part_a.at(x - 8, y - 5)[c] = a.at(x, y)[c];
                part_b.at(x - 8, y - 5)[c] = b.at(x, y)[c];
            }
        }
    CHECK(meanSquaredError(a, b, mask) == Approx(meanSquaredError(part_a, part_b)).epsilon(1e-12));
    CHECK(psnr(a, b, mask) == Approx(psnr(part_a, part_b)).epsilon(1e-12));
    CHECK(ssim(a, b, mask) == Approx(ssim(part_a, part_b)).epsilon(1e-9));
    CHECK(ssim(a, b, all) == Approx(ssim(a, b)).epsilon(1e-12));
    CHECK(meanSquaredError(a, b, all) == Approx(meanSquaredError(a, b)).epsilon(1e-12));
    CHECK_THROWS_AS(ssim(a, b, PixelMask(width, height)), UsageError);
    CHECK_THROWS_AS(psnr(a, b, PixelMask(width, height)), UsageError);
    CHECK_THROWS_AS(psnr(a, b, PixelMask(height, width)), UsageError);
}
