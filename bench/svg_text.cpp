// SPDX-License-Identifier: Apache-2.0
#include "bench/svg_text.h"

#include <cmath>
#include <cstdio>

namespace nerfvdb {
namespace {

constexpr const char* kStyle =
    "text{font-family:system-ui,-apple-system,'Segoe UI','DejaVu Sans',sans-serif;font-size:12px;fill:#2b2f36}"
    ".title{font-size:16px;font-weight:600}.small{font-size:10.5px;fill:#6a707b}"
    ".sheet{fill:#ffffff}.frame{fill:none;stroke:#8a909b}.grid{stroke:#e4e7eb}"
    ".front{fill:none;stroke:#8a909b;stroke-opacity:.45;stroke-width:9;stroke-linejoin:round;stroke-linecap:"
    "round}"
    "@media (prefers-color-scheme:dark){text{fill:#d9dde4}.small{fill:#959ba6}.sheet{fill:#15181d}"
    ".frame{stroke:#717783}.grid{stroke:#2a2f37}}";

}  // namespace

std::string escaped(const std::string& text) {
    std::string out;
    for (const char c : text) {
        switch (c) {
            case '&':
                out += "&amp;";
                break;
            case '<':
                out += "&lt;";
                break;
            case '>':
                out += "&gt;";
                break;
            case '"':
                out += "&quot;";
                break;
            default:
                out += static_cast<unsigned char>(c) < 0x20 ? ' ' : c;
        }
    }
    return out;
}

std::string px(double value) {
    char text[32];
    std::snprintf(text, sizeof text, "%.1f", std::round(value * 10) / 10 + 0.0);
    return text;
}

std::string textAt(double x, double y, const std::string& attributes, const std::string& text) {
    return "<text x=\"" + px(x) + "\" y=\"" + px(y) + "\"" + (attributes.empty() ? "" : " " + attributes) +
           ">" + escaped(text) + "</text>\n";
}

std::string lineBetween(double x0, double y0, double x1, double y1, const std::string& attributes) {
    return "<line x1=\"" + px(x0) + "\" y1=\"" + px(y0) + "\" x2=\"" + px(x1) + "\" y2=\"" + px(y1) + "\" " +
           attributes + "/>\n";
}

std::string svgBegin(double width, double height, const std::string& title) {
    return "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"" + px(width) +
           "\" height=\"" + px(height) + "\" viewBox=\"0 0 " + px(width) + " " + px(height) +
           "\" role=\"img\">\n<title>" + escaped(title) + "</title>\n<style>" + escaped(kStyle) +
           "</style>\n<rect class=\"sheet\" width=\"" + px(width) + "\" height=\"" + px(height) + "\"/>\n";
}

}  // namespace nerfvdb
