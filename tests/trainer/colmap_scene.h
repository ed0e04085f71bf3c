// SPDX-License-Identifier: Apache-2.0
// A small COLMAP model made by hand: eighteen images on a ring, three cameras, forty points, and where the images show
// them by formulas of their own. Written in either of COLMAP's formats.
#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <cstdint>
#include <iomanip>
#include <limits>
#include <sstream>
#include <string>
#include <vector>

#include "core/atomic_file.h"
#include "core/image.h"
#include "core/random.h"
#include "tests/support/temp_dir.h"
#include "trainer/colmap_model.h"

namespace nerfvdb::testing {

/// COLMAP's models as its documentation has them: a point in the camera (y down, z forward) to a pixel.
inline Vec2d colmapPixel(const ColmapCamera& camera, const Vec3d& point) {
    const std::vector<double>& p = camera.parameters;
    const std::string& m = camera.model;
    const bool one_focal = m == "SIMPLE_PINHOLE" || m.find("RADIAL") != m.npos;
    const double fx = p[0], fy = one_focal ? p[0] : p[1];
    const std::size_t c = one_focal ? 1 : 2;
    const auto k = [&](std::size_t i) { return p[c + 2 + i]; };
    const double u = point.x() / point.z(), v = point.y() / point.z(), r2 = u * u + v * v, r = std::sqrt(r2);
    double x = u, y = v;
    if (m == "SIMPLE_RADIAL") x *= 1 + k(0) * r2, y *= 1 + k(0) * r2;
    if (m == "RADIAL") x *= 1 + k(0) * r2 + k(1) * r2 * r2, y *= 1 + k(0) * r2 + k(1) * r2 * r2;
    if (m == "OPENCV" || m == "FULL_OPENCV") {
        double radial = 1 + k(0) * r2 + k(1) * r2 * r2;
        if (m == "FULL_OPENCV")
            radial = (radial + k(4) * r2 * r2 * r2) / (1 + k(5) * r2 + k(6) * r2 * r2 + k(7) * r2 * r2 * r2);
        x = u * radial + 2 * k(2) * u * v + k(3) * (r2 + 2 * u * u);
        y = v * radial + 2 * k(3) * u * v + k(2) * (r2 + 2 * v * v);
    }
    if (m.find("FISHEYE") != m.npos && r > 0) {
        const double t = std::atan(r), t2 = t * t;
        double bent = t;
        for (std::size_t i = 0; i < p.size() - c - 2; ++i)
            bent += k(i) * t * std::pow(t2, static_cast<double>(i + 1));
        x *= bent / r, y *= bent / r;
    }
    return {fx * x + p[c], fy * y + p[c + 1]};
}

inline Vec3d inColmapCamera(const ColmapImage& image, const Vec3d& point) {
    const auto& [w, x, y, z] = image.rotation;
    return Eigen::Quaterniond(w, x, y, z) * point + image.translation;
}

struct ColmapScene {
    TempDir dir;
    std::vector<ColmapCamera> cameras;
    std::vector<ColmapImage> images;
    std::vector<ColmapPoint> points;

    explicit ColmapScene(const std::string& odd_model = "OPENCV", std::vector<double> odd_parameters = {}) {
        if (odd_parameters.empty()) odd_parameters = {31, 30, 20.5, 9.5, 0.05, -0.02, 0.001, -0.002};
        cameras = {{3, "SIMPLE_RADIAL", 40, 20, {30, 20, 10, 0.03}},
                   {7, odd_model, 40, 20, odd_parameters},
                   {9, "PINHOLE", 40, 20, {29, 31, 19, 11}}};
        const auto unit = [](std::uint64_t i, std::uint64_t j) {
            return static_cast<double>(unitFloat(static_cast<std::uint32_t>(randomBits(5, i, j)))) - 0.5;
        };
        for (std::uint64_t i = 0; i < 40; ++i)
            points.push_back({100 + 3 * i, Vec3d(unit(i, 0), unit(i, 1), unit(i, 2)), 0});
        for (std::uint32_t i = 0; i < 18; ++i) {
            ColmapImage image;
            image.id = 50 - i;  // names do not go by ids
            image.camera = cameras[i % 3].id;
            image.name = "walk/" + std::to_string(100 + i) + ".png";
            const double angle = 0.35 * i;
            // A camera in the ring that looks at its middle: z forward, y down (world z is up).
            const Vec3d eye(3 * std::cos(angle), 3 * std::sin(angle), 1), forward = (-eye).normalized();
            Mat3d world_from_camera;
            world_from_camera.col(2) = forward;
            world_from_camera.col(0) = forward.cross(Vec3d::UnitZ()).normalized();
            world_from_camera.col(1) = forward.cross(world_from_camera.col(0));
            const Eigen::Quaterniond q(Mat3d(world_from_camera.transpose()));
            image.rotation = {q.w(), q.x(), q.y(), q.z()};
            image.translation = -(q * eye);
            for (std::size_t p = i % 2; p < points.size(); p += 2) {
                const Vec2d pixel = colmapPixel(cameras[i % 3], inColmapCamera(image, points[p].position));
                image.observations.push_back({pixel, points[p].id});
                ++points[p].track_length;
            }
            images.push_back(image);
        }
    }

    static std::string word(std::uint64_t value, int bytes) {
        return {reinterpret_cast<const char*>(&value), static_cast<std::size_t>(bytes)};
    }
    static std::string word(double value) { return {reinterpret_cast<const char*>(&value), sizeof value}; }

    std::string camerasBinary() const {
        const std::vector<std::string> names{"SIMPLE_PINHOLE", "PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV",
                                             "OPENCV_FISHEYE", "FULL_OPENCV", "FOV", "SIMPLE_RADIAL_FISHEYE",
                                             "RADIAL_FISHEYE"};
        std::string out = word(cameras.size(), 8);
        for (const ColmapCamera& camera : cameras) {
            std::uint64_t model = 0;
            while (model < names.size() && names[model] != camera.model) ++model;
            out += word(camera.id, 4) + word(model, 4) + word(camera.width, 8) + word(camera.height, 8);
            for (const double value : camera.parameters) out += word(value);
        }
        return out;
    }
    std::string imagesBinary() const {
        std::string out = word(images.size(), 8);
        for (const ColmapImage& image : images) {
            out += word(image.id, 4);
            for (const double value : image.rotation) out += word(value);
            for (const double value : image.translation) out += word(value);
            out += word(image.camera, 4) + image.name + std::string(1, '\0');
            out += word(image.observations.size() + 1, 8) + word(1.5) + word(2.5) + word(~0ull, 8);  // one of no point
            for (const ColmapObservation& seen : image.observations)
                out += word(seen.pixel.x()) + word(seen.pixel.y()) + word(seen.point, 8);
        }
        return out;
    }
    std::string pointsBinary() const {
        std::string out = word(points.size(), 8);
        for (const ColmapPoint& point : points) {
            out += word(point.id, 8);
            for (const double value : point.position) out += word(value);
            out += std::string("\1\2\3") + word(0.5) + word(point.track_length, 8);
            for (std::size_t i = 0; i < point.track_length; ++i) out += word(1, 4) + word(i, 4);
        }
        return out;
    }

    static std::ostringstream textFile(const std::string& comment) {
        std::ostringstream out;
        out << "# " << comment << "\n" << std::setprecision(17);
        return out;
    }
    std::string camerasText() const {
        std::ostringstream out = textFile("CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]");
        for (const ColmapCamera& camera : cameras) {
            out << camera.id << " " << camera.model << " " << camera.width << " " << camera.height;
            for (const double value : camera.parameters) out << " " << value;
            out << "\n";
        }
        return out.str();
    }
    std::string imagesText() const {
        std::ostringstream out = textFile("IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME");
        for (const ColmapImage& image : images) {
            out << image.id;
            for (const double value : image.rotation) out << " " << value;
            for (const double value : image.translation) out << " " << value;
            out << " " << image.camera << " " << image.name << "\n1.5 2.5 -1";
            for (const ColmapObservation& seen : image.observations)
                out << " " << seen.pixel.x() << " " << seen.pixel.y() << " " << seen.point;
            out << "\n";
        }
        return out.str();
    }
    std::string pointsText() const {
        std::ostringstream out = textFile("POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)");
        for (const ColmapPoint& point : points) {
            out << point.id;
            for (const double value : point.position) out << " " << value;
            out << " 1 2 3 0.5";
            for (std::size_t i = 0; i < point.track_length; ++i) out << " 1 " << i;
            out << "\n";
        }
        return out.str();
    }

    std::filesystem::path folder(const std::string& place) const {
        std::filesystem::create_directories(dir / place);
        return dir / place;
    }
    void saveBinary(const std::string& place = "sparse/0") const {
        writeAtomically(folder(place) / "cameras.bin", camerasBinary());
        writeAtomically(folder(place) / "images.bin", imagesBinary());
        writeAtomically(folder(place) / "points3D.bin", pointsBinary());
    }
    void saveText(const std::string& place = "sparse/0") const {
        writeAtomically(folder(place) / "cameras.txt", camerasText());
        writeAtomically(folder(place) / "images.txt", imagesText());
        writeAtomically(folder(place) / "points3D.txt", pointsText());
    }
    void savePhotos(const std::string& place = "images", int width = 40, int height = 20) const {
        folder(place + "/walk");
        for (const ColmapImage& image : images) writeImage(dir / place / image.name, Image(width, height, 3));
    }
};

}  // namespace nerfvdb::testing
