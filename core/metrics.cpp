// SPDX-License-Identifier: Apache-2.0
#include "core/metrics.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "core/error.h"
#include "core/parallel.h"

namespace nerfvdb {
namespace {

constexpr int kWindow = 11;
constexpr double kWindowSigma = 1.5;
constexpr double kC1 = 0.01 * 0.01, kC2 = 0.03 * 0.03;  // (K L)^2 with L = 1
constexpr std::size_t kRowsPerTask = 16;
constexpr double kPsnrOfIdentical = 100;

void checkComparable(const Image& a, const Image& b, const char* metric) {
    const auto shape = [](const Image& image) {
        return std::to_string(image.width) + "x" + std::to_string(image.height) + "x" +
               std::to_string(image.channels);
    };
    if (a.width != b.width || a.height != b.height || a.channels != b.channels || a.pixels.empty())
        throw UsageError(metric, "images of " + shape(a) + " and " + shape(b), "equal sizes, not empty");
}

/// Adds task(begin, end) over blocks of rows, in the order of rows: the sum does not depend on threads.
template <typename Task>
double sumOverRows(int n_rows, const Task& task) {
    const std::size_t n = static_cast<std::size_t>(n_rows);
    std::vector<double> partial((n + kRowsPerTask - 1) / kRowsPerTask);
    parallelRanges(n, kRowsPerTask, [&](std::size_t begin, std::size_t end) {
        partial[begin / kRowsPerTask] = task(static_cast<int>(begin), static_cast<int>(end));
    });
    double sum = 0;
    for (const double value : partial) sum += value;
    return sum;
}

std::array<double, kWindow> gaussianWindow() {
    std::array<double, kWindow> window;
    double sum = 0;
    for (int i = 0; i < kWindow; ++i) {
        const double x = i - kWindow / 2;
        window[i] = std::exp(-x * x / (2 * kWindowSigma * kWindowSigma));
        sum += window[i];
    }
    for (double& w : window) w /= sum;
    return window;
}

/// Weighted means of a, b, a^2 + b^2 and a b: all that the structural similarity needs, since the two variances
/// only occur as their sum. Interleaved channels, one row.
struct Moments {
    explicit Moments(std::size_t n) : a(n), b(n), squares(n), product(n) {}
    void clear() {
        for (std::vector<double>* row : {&a, &b, &squares, &product}) std::fill(row->begin(), row->end(), 0.0);
    }
    std::vector<double> a, b, squares, product;
};

/// Adds one row of both images, times its weight in the window.
void addRow(const float* a, const float* b, double weight, Moments& moments) {
    const std::size_t n = moments.a.size();
    double* const sum_a = moments.a.data();
    double* const sum_b = moments.b.data();
    double* const squares = moments.squares.data();
    double* const product = moments.product.data();
    for (std::size_t i = 0; i < n; ++i) {
        const double value_a = a[i], value_b = b[i];
        sum_a[i] += weight * value_a;
        sum_b[i] += weight * value_b;
        squares[i] += weight * (value_a * value_a + value_b * value_b);
        product[i] += weight * (value_a * value_b);
    }
}

/// Window across the columns: out[i] = sum_k window[k] row[i + k * channels].
void blurAcross(const std::array<double, kWindow>& window, const std::vector<double>& row, int channels,
                std::vector<double>& out) {
    const double* const in = row.data();
    double* const result = out.data();
    for (std::size_t i = 0; i < out.size(); ++i) {
        double sum = 0;
        for (int k = 0; k < kWindow; ++k) sum += window[k] * in[i + static_cast<std::size_t>(k * channels)];
        result[i] = sum;
    }
}

/// Sum of the structural similarity over columns [begin, end) of a row of blurred moments; Wang et al. 2004, eq. 13.
double sumSimilarity(const Moments& m, std::size_t begin, std::size_t end) {
    double sum = 0;
    for (std::size_t i = begin; i < end; ++i) {
        const double means_squared = m.a[i] * m.a[i] + m.b[i] * m.b[i];
        const double means_product = m.a[i] * m.b[i];
        const double variances = m.squares[i] - means_squared;
        const double covariance = m.product[i] - means_product;
        sum += (2 * means_product + kC1) * (2 * covariance + kC2) / ((means_squared + kC1) * (variances + kC2));
    }
    return sum;
}

void checkMask(const Image& image, const PixelMask& mask, const char* metric) {
    if (!mask.empty() && (mask.width() != image.width || mask.height() != image.height))
        throw UsageError(metric, "a mask of another size", "that of the images");
}

/// Mean squared error over the pixels that count.
double maskedError(const Image& a, const Image& b, const PixelMask& mask) {
    const double sum = sumOverRows(a.height, [&](int begin, int end) {
        double rows_sum = 0;
        for (int y = begin; y < end; ++y)
            for (int x = 0; x < a.width; ++x) {
                if (!mask.counts(x, y)) continue;
                for (int c = 0; c < a.channels; ++c) {
                    const double difference = static_cast<double>(a.at(x, y)[c]) - b.at(x, y)[c];
                    rows_sum += difference * difference;
                }
            }
        return rows_sum;
    });
    const std::size_t n = mask.count();
    if (n == 0) throw UsageError("meanSquaredError", "a mask without a pixel that counts", "at least one");
    return sum / (static_cast<double>(n) * a.channels);
}

/// Which windows hold no pixel that does not count: one flag for each, rows from the top.
std::vector<std::uint8_t> wholeWindows(const PixelMask& mask, int out_width, int out_height) {
    std::vector<std::uint8_t> is_whole(static_cast<std::size_t>(out_width) * out_height);
    std::vector<int> above(static_cast<std::size_t>(mask.width()), 0);  // pixels that count without a gap, downwards
    for (int y = 0; y < mask.height(); ++y) {
        int across = 0;  // columns without a gap in the window's rows
        for (int x = 0; x < mask.width(); ++x) {
            above[x] = mask.counts(x, y) ? above[x] + 1 : 0;
            across = above[x] >= kWindow ? across + 1 : 0;
            if (across >= kWindow)
                is_whole[static_cast<std::size_t>(y - kWindow + 1) * out_width + (x - kWindow + 1)] = 1;
        }
    }
    return is_whole;
}

}  // namespace

double meanSquaredError(const Image& a, const Image& b, const PixelMask& mask) {
    checkComparable(a, b, "meanSquaredError");
    checkMask(a, mask, "meanSquaredError");
    if (!mask.empty()) return maskedError(a, b, mask);
    const std::size_t row = static_cast<std::size_t>(a.width) * a.channels;
    const double sum = sumOverRows(a.height, [&](int begin, int end) {
        double rows_sum = 0;
        for (std::size_t i = begin * row; i < end * row; ++i) {
            const double difference = static_cast<double>(a.pixels[i]) - b.pixels[i];
            rows_sum += difference * difference;
        }
        return rows_sum;
    });
    return sum / static_cast<double>(a.pixels.size());
}

double psnrFromMse(double mse) {
    return mse > 0 ? std::min(kPsnrOfIdentical, -10 * std::log10(mse)) : mse == 0 ? kPsnrOfIdentical : mse;
}

double psnr(const Image& a, const Image& b, const PixelMask& mask) {
    return psnrFromMse(meanSquaredError(a, b, mask));
}

double ssim(const Image& a, const Image& b, const PixelMask& mask) {
    checkComparable(a, b, "ssim");
    checkMask(a, mask, "ssim");
    if (a.width < kWindow || a.height < kWindow)
        throw UsageError("ssim", "images of " + std::to_string(a.width) + "x" + std::to_string(a.height),
                         "at least 11x11");
    const std::array<double, kWindow> window = gaussianWindow();
    const int out_height = a.height - kWindow + 1, out_width = a.width - kWindow + 1;
    const std::size_t in_row = static_cast<std::size_t>(a.width) * a.channels;
    const std::size_t out_row = static_cast<std::size_t>(out_width) * a.channels;
    std::vector<std::uint8_t> is_whole;
    if (!mask.empty()) is_whole = wholeWindows(mask, out_width, out_height);
    const auto n_windows = mask.empty() ? static_cast<double>(out_height) * out_width
                                        : static_cast<double>(std::count(is_whole.begin(), is_whole.end(), 1));
    if (n_windows == 0) throw UsageError("ssim", "a mask with no window of 11x11 pixels that all count", "one at least");

    const double sum = sumOverRows(out_height, [&](int begin, int end) {
        Moments down(in_row), both(out_row);
        double rows_sum = 0;
        for (int y = begin; y < end; ++y) {
            down.clear();
            for (int k = 0; k < kWindow; ++k) addRow(a.at(0, y + k), b.at(0, y + k), window[k], down);
            blurAcross(window, down.a, a.channels, both.a);
            blurAcross(window, down.b, a.channels, both.b);
            blurAcross(window, down.squares, a.channels, both.squares);
            blurAcross(window, down.product, a.channels, both.product);
            if (mask.empty()) {
                rows_sum += sumSimilarity(both, 0, out_row);
                continue;
            }
            for (int x = 0; x < out_width; ++x)
                if (is_whole[static_cast<std::size_t>(y) * out_width + x])
                    rows_sum += sumSimilarity(both, static_cast<std::size_t>(x) * a.channels,
                                              static_cast<std::size_t>(x + 1) * a.channels);
        }
        return rows_sum;
    });
    return sum / (n_windows * a.channels);
}

}  // namespace nerfvdb
