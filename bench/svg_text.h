// SPDX-License-Identifier: Apache-2.0
// Pieces of SVG that all pictures of this program are made of, readable on light and on dark pages.
#pragma once

#include <string>

namespace nerfvdb {

/// The head of a document of so many pixels: its style (classes title, small, sheet, frame, grid, front) and its sheet.
/// What follows ends with "</svg>\n".
std::string svgBegin(double width, double height, const std::string& title);

/// Text as XML has it.
std::string escaped(const std::string& text);

/// Pixels with one decimal; no "-0.0".
std::string px(double value);

/// `attributes` as they stand in a tag, or empty.
std::string textAt(double x, double y, const std::string& attributes, const std::string& text);
std::string lineBetween(double x0, double y0, double x1, double y1, const std::string& attributes);

}  // namespace nerfvdb
