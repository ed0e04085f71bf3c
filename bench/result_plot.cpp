// SPDX-License-Identifier: Apache-2.0
#include "bench/result_plot.h"

#include <algorithm>

#include "bench/pareto.h"
#include "bench/repeat.h"
#include "core/atomic_file.h"

namespace nerfvdb {
namespace {

std::string axisLabel(const BenchColumn& column) {
    return column.name + (column.unit.empty() ? "" : ", " + column.unit);
}

PlotSeries& seriesOf(Plot& plot, const std::string& name) {
    for (PlotSeries& series : plot.series)
        if (series.name == name) return series;
    plot.series.push_back({name, {}});
    return plot.series.back();
}

Plot emptyPlot(const BenchResult& result) {
    Plot plot;
    plot.title = result.title;
    plot.footer = factsLine(result.facts);
    return plot;
}

}  // namespace

Plot plotColumns(const BenchResult& result, const std::string& x_column, const std::string& y_column) {
    const std::size_t x = result.column(x_column), y = result.column(y_column);
    Plot plot = emptyPlot(result);
    plot.x.label = axisLabel(result.columns[x]);
    plot.y.label = axisLabel(result.columns[y]);
    for (const BenchRow& row : result.rows) {
        if (row.cells[x].empty() || row.cells[y].empty()) continue;
        const Summary value = summarize(row.cells[y]);
        seriesOf(plot, row.series)
            .points.push_back({summarize(row.cells[x]).median, value.median, row.label, value.low, value.high});
    }
    return plot;
}

void markFront(Plot& plot) {
    std::vector<CostQuality> points;
    for (const PlotSeries& series : plot.series)
        for (const PlotPoint& point : series.points) points.push_back({point.x, point.y});
    plot.front.clear();
    for (const std::size_t i : paretoFront(points)) plot.front.emplace_back(points[i].cost, points[i].quality);
}

Plot plotByLabel(const BenchResult& result, const std::string& x_column) {
    const std::size_t x = result.column(x_column);
    Plot plot = emptyPlot(result);
    plot.x.label = axisLabel(result.columns[x]);
    std::vector<std::string>& names = plot.y.categories;
    for (const BenchRow& row : result.rows) {
        if (row.cells[x].empty()) continue;
        auto name = std::find(names.begin(), names.end(), row.label);
        if (name == names.end()) name = names.insert(names.end(), row.label);
        PlotSeries& series = seriesOf(plot, row.series);
        series.stroke = Stroke::none;
        series.points.push_back({summarize(row.cells[x]).median, static_cast<double>(name - names.begin()),
                                 row.series + ", " + row.label});
    }
    return plot;
}

void writeResult(const BenchResult& result, const Plot& plot, const std::filesystem::path& folder) {
    writeAtomically(folder / (result.kind + ".json"), jsonText(result));
    writeAtomically(folder / (result.kind + ".csv"), csvText(result));
    writeAtomically(folder / (result.kind + ".svg"), svgText(plot));
}

}  // namespace nerfvdb
