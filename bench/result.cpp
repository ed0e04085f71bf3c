// SPDX-License-Identifier: Apache-2.0
#include "bench/result.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <set>

#include "bench/number_text.h"
#include "bench/repeat.h"
#include "core/error.h"
#include "trainer/json_node.h"

namespace nerfvdb {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kFormat = "nerfvdb bench 1";
constexpr const char* kBetter[] = {"neither", "lower", "higher"};
constexpr const char* kNoise[] = {"exact", "noisy", "timed"};

Json factsJson(const RunFacts& facts) {
    return {{"version", facts.version},
            {"commit", facts.commit},
            {"compiler", facts.compiler},
            {"cpu", facts.cpu},
            {"cores", facts.cores},
            {"threads", facts.threads},
            {"simd_target", facts.simd_target},
            {"date", facts.date},
            {"load", facts.load},
            {"yardstick_s", facts.yardstick_s}};
}

RunFacts factsFrom(const JsonNode& node) {
    RunFacts facts;
    facts.version = node.at("version").text();
    facts.commit = node.at("commit").text();
    facts.compiler = node.at("compiler").text();
    facts.cpu = node.at("cpu").text();
    facts.cores = node.at("cores").wholeNumber(0, 1 << 20);
    facts.threads = node.at("threads").wholeNumber(0, 1 << 20);
    facts.simd_target = node.at("simd_target").text();
    facts.date = node.at("date").text();
    facts.load = node.at("load").number();
    facts.yardstick_s = node.at("yardstick_s").number();
    return facts;
}

template <typename Enum, std::size_t N>
Enum enumFrom(const JsonNode& node, const char* const (&names)[N]) {
    const std::string text = node.text();
    for (std::size_t i = 0; i < N; ++i)
        if (text == names[i]) return static_cast<Enum>(i);
    std::string expected;
    for (const char* name : names) expected += (expected.empty() ? "" : ", ") + std::string(name);
    node.fail("'" + text + "'", "one of " + expected);
}

/// A field of a CSV file, quoted where it must be (RFC 4180).
std::string csvField(const std::string& text) {
    if (text.find_first_of(",\"\n") == std::string::npos) return text;
    std::string quoted = "\"";
    for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
    return quoted + "\"";
}

bool hasRepeats(const BenchResult& result, std::size_t column) {
    return std::any_of(result.rows.begin(), result.rows.end(),
                       [&](const BenchRow& row) { return row.cells[column].size() > 1; });
}

}  // namespace

BenchColumn secondsColumn(const std::string& name) { return {name, "s", Better::lower, Noise::timed, 0.03, 0}; }
BenchColumn decibelColumn(const std::string& name) {
    return {name, "dB", Better::higher, Noise::exact, 0, 0.05};
}

std::size_t BenchResult::column(const std::string& name) const {
    for (std::size_t c = 0; c < columns.size(); ++c)
        if (columns[c].name == name) return c;
    throw UsageError("result of bench " + kind, "no column '" + name + "'", "one of its columns");
}

double BenchResult::median(const BenchRow& row, const std::string& column_name) const {
    const std::vector<double>& cell = row.cells[column(column_name)];
    return cell.empty() ? std::numeric_limits<double>::quiet_NaN() : summarize(cell).median;
}

std::string jsonText(const BenchResult& result) {
    Json json = {{"format", kFormat},        {"kind", result.kind},
                 {"title", result.title},    {"facts", factsJson(result.facts)},
                 {"columns", Json::array()}, {"rows", Json::array()},
                 {"figures", Json::array()}, {"notes", result.notes}};
    for (const BenchColumn& column : result.columns)
        json["columns"].push_back({{"name", column.name},
                                   {"unit", column.unit},
                                   {"better", kBetter[static_cast<int>(column.better)]},
                                   {"noise", kNoise[static_cast<int>(column.noise)]},
                                   {"min_share", column.min_share},
                                   {"min_difference", column.min_difference}});
    for (const BenchRow& row : result.rows)
        json["rows"].push_back({{"series", row.series}, {"label", row.label}, {"cells", row.cells}});
    for (const auto& [name, value] : result.figures)
        json["figures"].push_back({{"name", name}, {"value", value}});
    // Names of scenes come from paths, which need not be UTF-8.
    return json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

std::string csvText(const BenchResult& result) {
    std::string text = "series,label";
    for (std::size_t c = 0; c < result.columns.size(); ++c) {
        const std::string& name = result.columns[c].name;
        text += "," + csvField(name);
        if (hasRepeats(result, c)) text += "," + csvField(name + "_low") + "," + csvField(name + "_high");
    }
    text += "\n";
    for (const BenchRow& row : result.rows) {
        text += csvField(row.series) + "," + csvField(row.label);
        for (std::size_t c = 0; c < result.columns.size(); ++c) {
            const Summary summary = summarize(row.cells[c]);
            const auto number = [&](double value) {
                return "," + (summary.n ? exactText(value) : std::string());
            };
            text += number(summary.median);
            if (hasRepeats(result, c)) text += number(summary.low) + number(summary.high);
        }
        text += "\n";
    }
    return text;
}

std::string tableText(const BenchResult& result) {
    std::vector<std::vector<std::string>> lines(1 + result.rows.size());
    lines[0] = {"", ""};
    for (const BenchColumn& column : result.columns)
        lines[0].push_back(column.name + (column.unit.empty() ? "" : " [" + column.unit + "]"));
    for (std::size_t r = 0; r < result.rows.size(); ++r) {
        const BenchRow& row = result.rows[r];
        const bool is_new_series = r == 0 || result.rows[r - 1].series != row.series;
        lines[r + 1] = {is_new_series ? row.series : "", row.label};
        for (const std::vector<double>& cell : row.cells)
            lines[r + 1].push_back(cell.empty() ? "-" : numberText(summarize(cell).median));
    }

    std::vector<std::size_t> widths(lines[0].size(), 0);
    for (const auto& line : lines)
        for (std::size_t c = 0; c < line.size(); ++c) widths[c] = std::max(widths[c], line[c].size());
    std::string text = result.title + "\n" + factsLine(result.facts) + "\n\n";
    for (const auto& line : lines) {
        std::string written;
        for (std::size_t c = 0; c < line.size(); ++c) {
            const std::string padding(widths[c] - line[c].size(), ' ');
            written += c < 2 ? line[c] + padding + "  " : padding + line[c] + "  ";
        }
        text += written.substr(0, written.find_last_not_of(' ') + 1) + "\n";
    }
    for (const auto& [name, value] : result.figures) text += name + ": " + numberText(value) + "\n";
    for (const std::string& note : result.notes) text += "Note: " + note + "\n";
    return text;
}

BenchResult readResult(const std::filesystem::path& path) {
    const nlohmann::json document = parseJsonFile(path);
    const JsonNode root(document, path);
    if (!root.has("format") || root.at("format").text() != kFormat)
        throw DataError(path.string(), "JSON of another kind",
                        std::string("a result: \"format\": \"") + kFormat + "\"",
                        "'nerfvdb bench KIND --out DIR' writes such files");
    BenchResult result;
    result.kind = root.at("kind").text();
    result.title = root.at("title").text();
    result.facts = factsFrom(root.at("facts"));
    const JsonNode columns = root.at("columns"), rows = root.at("rows");
    std::set<std::string> column_names;
    for (std::size_t c = 0; c < columns.arraySize(); ++c) {
        const JsonNode node = columns.element(c);
        if (!column_names.insert(node.at("name").text()).second)
            node.fail("a second column of one name: " + node.at("name").text(), "each name once");
        result.columns.push_back({node.at("name").text(), node.at("unit").text(),
                                  enumFrom<Better>(node.at("better"), kBetter),
                                  enumFrom<Noise>(node.at("noise"), kNoise), node.at("min_share").number(),
                                  node.at("min_difference").number()});
    }
    std::set<std::pair<std::string, std::string>> row_names;
    for (std::size_t r = 0; r < rows.arraySize(); ++r) {
        const JsonNode node = rows.element(r), cells = node.at("cells");
        BenchRow row{node.at("series").text(), node.at("label").text(), {}};
        if (!row_names.emplace(row.series, row.label).second)
            node.fail("a second row of one series and label: " + row.series + ", " + row.label, "each once");
        if (cells.arraySize() != result.columns.size())
            cells.fail(std::to_string(cells.arraySize()) + " cells",
                       std::to_string(result.columns.size()) + ", one a column");
        for (std::size_t c = 0; c < cells.arraySize(); ++c) {
            const JsonNode cell = cells.element(c);
            row.cells.emplace_back();
            for (std::size_t i = 0; i < cell.arraySize(); ++i)
                row.cells.back().push_back(cell.element(i).number());
        }
        result.rows.push_back(std::move(row));
    }
    const JsonNode figures = root.at("figures"), notes = root.at("notes");
    for (std::size_t i = 0; i < figures.arraySize(); ++i)
        result.figures.emplace_back(figures.element(i).at("name").text(),
                                    figures.element(i).at("value").number());
    for (std::size_t i = 0; i < notes.arraySize(); ++i) result.notes.push_back(notes.element(i).text());
    return result;
}

}  // namespace nerfvdb
