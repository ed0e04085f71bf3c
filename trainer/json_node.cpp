// SPDX-License-Identifier: Apache-2.0
#include "trainer/json_node.h"

#include <cmath>
#include <string_view>

#include "core/atomic_file.h"
#include "core/error.h"

namespace nerfvdb {
namespace {

/// Puts quotes around NaN, Infinity and -Infinity wherever they stand outside strings.
std::string quoteNonNumbers(std::string_view text) {
    std::string result;
    result.reserve(text.size());
    bool in_string = false;
    for (std::size_t i = 0; i < text.size(); ++i) {
        if (!in_string)
            for (const std::string_view word : {"-Infinity", "Infinity", "NaN"})
                if (text.substr(i, word.size()) == word) {
                    result.append("\"").append(word).append("\"");
                    i += word.size();
                    break;
                }
        if (i == text.size()) break;
        result += text[i];
        if (text[i] == '"') in_string = !in_string;
        if (text[i] == '\\' && in_string && i + 1 < text.size()) result += text[++i];  // an escaped quote
    }
    return result;
}

}  // namespace

nlohmann::json parseJsonFile(const std::filesystem::path& path) {
    const std::string text = readFile(path);
    try {
        return nlohmann::json::parse(quoteNonNumbers(text));
    } catch (const nlohmann::json::exception& error) {
        // "[json.exception.parse_error.101] parse error at line 3, column 7: ...", or out_of_range for 1e400
        const std::string_view what = error.what();
        const std::size_t begin = what.find("] ");
        throw DataError(path.string(), std::string(begin == what.npos ? what : what.substr(begin + 2)),
                        "well-formed JSON", "the file is damaged or was cut short: write it again");
    }
}

JsonNode JsonNode::at(const char* key) const {
    if (!value_->is_object()) fail(found(), "an object with the key '" + std::string(key) + "'");
    if (!value_->contains(key)) fail("no key '" + std::string(key) + "'", "one");
    return {(*value_)[key], file_, field_.empty() ? key : field_ + "." + key};
}

JsonNode JsonNode::element(std::size_t index) const {
    if (index >= arraySize())
        fail(std::to_string(arraySize()) + " elements", "at least " + std::to_string(index + 1));
    return {(*value_)[index], file_, field_ + "[" + std::to_string(index) + "]"};
}

std::size_t JsonNode::arraySize() const {
    if (!value_->is_array()) fail(found(), "an array");
    return value_->size();
}

double JsonNode::number() const {
    if (!value_->is_number() || !std::isfinite(value_->get<double>())) fail(found(), "a finite number");
    return value_->get<double>();
}

double JsonNode::positiveNumber() const {
    if (!(number() > 0)) fail(found(), "a number above zero");
    return number();
}

int JsonNode::wholeNumber(int lowest, int highest) const {
    const double value = number();
    if (value != std::floor(value) || value < lowest || value > highest)
        fail(found(), "a whole number from " + std::to_string(lowest) + " to " + std::to_string(highest));
    return static_cast<int>(value);
}

std::string JsonNode::text() const {
    if (!value_->is_string()) fail(found(), "a text");
    return value_->get<std::string>();
}

void JsonNode::fail(const std::string& found, const std::string& expected, const std::string& advice) const {
    throw DataError(field_.empty() ? file_ : file_ + ": " + field_, found, expected, advice);
}

std::string JsonNode::found() const {
    if (value_->is_object()) return "an object";
    if (value_->is_array()) return "an array of " + std::to_string(value_->size());
    const std::string dump = value_->dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
    return dump.size() <= 60 ? dump : dump.substr(0, 57) + "...";
}

}  // namespace nerfvdb
