// SPDX-License-Identifier: Apache-2.0
// JPEG files that tell how they were taken.
#pragma once

#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace nerfvdb::testing {

struct Exif {
    std::string make, model;
    double focal_length_mm = 0;
    std::optional<std::pair<double, double>> latitude_longitude;  // degrees
};

/// A TIFF directory in the making: entries of 12 bytes, then the values that do not fit into them (TIFF 6.0, section 2).
class ExifDirectory {
public:
    void addText(int tag, std::string text) {
        text += '\0';
        entries_.push_back({tag, 2, static_cast<std::uint32_t>(text.size()), text});
    }
    void addRationals(int tag, const std::vector<double>& values) {
        std::string bytes;
        for (const double value : values) {
            put(bytes, static_cast<std::uint32_t>(std::lround(value * 10000)), 4);
            put(bytes, 10000, 4);
        }
        entries_.push_back({tag, 5, static_cast<std::uint32_t>(values.size()), bytes});
    }
    void addOffset(int tag, std::uint32_t offset) {
        std::string bytes;
        put(bytes, offset, 4);
        entries_.push_back({tag, 4, 1, bytes});
    }
    bool empty() const { return entries_.empty(); }

    /// The directory as it stands at `begin` of the TIFF block.
    std::string bytesAt(std::size_t begin) const {
        std::string head, values;
        const std::size_t values_begin = begin + 2 + 12 * entries_.size() + 4;
        put(head, static_cast<std::uint32_t>(entries_.size()), 2);
        for (const Entry& entry : entries_) {
            put(head, static_cast<std::uint32_t>(entry.tag), 2);
            put(head, static_cast<std::uint32_t>(entry.type), 2);
            put(head, entry.count, 4);
            if (entry.value.size() <= 4) {
                head += entry.value + std::string(4 - entry.value.size(), '\0');
            } else {
                put(head, static_cast<std::uint32_t>(values_begin + values.size()), 4);
                values += entry.value;
                if (values.size() % 2) values += '\0';
            }
        }
        return head + std::string(4, '\0') + values;
    }

    static void put(std::string& bytes, std::uint32_t value, int n_bytes) {
        for (int i = 0; i < n_bytes; ++i) bytes += static_cast<char>(value >> (8 * i) & 255);
    }

private:
    struct Entry {
        int tag, type;
        std::uint32_t count;
        std::string value;
    };
    std::vector<Entry> entries_;
};

/// A JPEG's bytes with an EXIF segment after its first marker.
inline std::string withExif(const std::string& jpeg, const Exif& exif) {
    const auto degrees = [](double angle) {
        angle = std::abs(angle);
        const double whole = std::floor(angle), minutes = std::floor(60 * (angle - whole));
        return std::vector<double>{whole, minutes, 3600 * (angle - whole - minutes / 60)};
    };
    ExifDirectory photo, place;
    if (exif.focal_length_mm > 0) photo.addRationals(0x920a, {exif.focal_length_mm});
    if (exif.latitude_longitude) {
        const auto [latitude, longitude] = *exif.latitude_longitude;
        place.addText(1, latitude < 0 ? "S" : "N");
        place.addRationals(2, degrees(latitude));
        place.addText(3, longitude < 0 ? "W" : "E");
        place.addRationals(4, degrees(longitude));
    }
    // The main directory points to the others, whose places depend on its length: laid out twice.
    std::size_t photo_begin = 0, place_begin = 0;
    std::string tiff;
    for (int pass = 0; pass < 2; ++pass) {
        ExifDirectory main;
        if (!exif.make.empty()) main.addText(0x010f, exif.make);
        if (!exif.model.empty()) main.addText(0x0110, exif.model);
        if (!photo.empty()) main.addOffset(0x8769, static_cast<std::uint32_t>(photo_begin));
        if (!place.empty()) main.addOffset(0x8825, static_cast<std::uint32_t>(place_begin));
        tiff = std::string("II*\0\x08\0\0\0", 8);
        tiff += main.bytesAt(tiff.size());
        photo_begin = tiff.size();
        if (!photo.empty()) tiff += photo.bytesAt(photo_begin);
        place_begin = tiff.size();
        if (!place.empty()) tiff += place.bytesAt(place_begin);
    }
    const std::string content = std::string("Exif\0\0", 6) + tiff;
    const std::size_t length = content.size() + 2;
    const std::string segment = std::string("\xff\xe1", 2) + static_cast<char>(length >> 8) +
                                static_cast<char>(length & 255) + content;
    return jpeg.substr(0, 2) + segment + jpeg.substr(2);
}

}  // namespace nerfvdb::testing
