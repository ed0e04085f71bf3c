// SPDX-License-Identifier: Apache-2.0
// A JSON value that knows its place, so that every complaint names file and field. For readers' .cpp files.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

namespace nerfvdb {

/// Parses a file. Throws IoError, or DataError with line and column, or with the number that no double can hold.
/// Bare NaN and Infinity, which Python writes though JSON has no such thing, become strings, so that the field
/// that holds them is named when it is read.
nlohmann::json parseJsonFile(const std::filesystem::path& path);

/// Borrows a value of a parsed document; `place` reads like "fox/transforms.json: frames[3].file_path".
/// Every access that finds something else than it expects throws DataError.
class JsonNode {
public:
    /// The whole document.
    JsonNode(const nlohmann::json& document, const std::filesystem::path& file)
        : value_(&document), file_(file.string()) {}

    bool has(const char* key) const { return value_->is_object() && value_->contains(key); }
    JsonNode at(const char* key) const;
    JsonNode element(std::size_t index) const;
    std::size_t arraySize() const;  // must be an array

    double number() const;          // finite
    double positiveNumber() const;  // finite and above zero
    int wholeNumber(int lowest, int highest) const;
    std::string text() const;
    bool isTrue() const { return value_->is_boolean() && value_->get<bool>(); }

    /// Throws DataError about this value.
    [[noreturn]] void fail(const std::string& found, const std::string& expected,
                           const std::string& advice = {}) const;

private:
    JsonNode(const nlohmann::json& value, std::string file, std::string field)
        : value_(&value), file_(std::move(file)), field_(std::move(field)) {}
    std::string found() const;  // what the value is, in short

    const nlohmann::json* value_;
    std::string file_;
    std::string field_;
};

}  // namespace nerfvdb
