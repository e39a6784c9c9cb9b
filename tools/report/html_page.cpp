#include "tools/report/html_page.h"

#include <array>
#include <charconv>
#include <cmath>
#include <system_error>

#include "tools/report/chart_js.h"

namespace beltgrip::report {
namespace {

constexpr std::string_view kStyle = R"(
body { font: 15px/1.45 sans-serif; max-width: 1180px; margin: 2em auto; padding: 0 1em; color: #222; }
h1 { font-size: 1.5em; } h2 { font-size: 1.2em; margin-top: 2em; }
.table { overflow-x: auto; }
table { border-collapse: collapse; margin: 0.7em 0; }
th, td { border: 1px solid #ccc; padding: 0.25em 0.6em; text-align: left; vertical-align: top; }
th { background: #f3f3f3; }
.charts { display: grid; grid-template-columns: repeat(auto-fill, minmax(min(370px, 100%), 1fr)); gap: 1em; }
.chart { position: relative; height: 320px; min-width: 0; }
@media print {
  body { max-width: none; margin: 0; font-size: 11px; }
  .charts { grid-template-columns: 1fr 1fr; }
  .chart, tr { break-inside: avoid; }
  .chart { height: 250px; }
  h2 { break-after: avoid; }
}
)";

// One scatter chart per entry of `data`; a series is [name, is a line, is dashed, [x, y, x, y,
// ...]].
constexpr std::string_view kScript = R"(
// Told apart without red and green (Okabe and Ito); points differ in shape as well.
const colours = ['#0072B2', '#D55E00', '#009E73', '#CC79A7', '#E69F00', '#56B4E9', '#000000',
                 '#8C8C8C'];
const shapes = ['circle', 'triangle', 'rect', 'crossRot', 'star'];
// What bears the same name has the same colour in every chart of the page.
const names = [];
const colourOf = (name) => {
  if (!names.includes(name)) names.push(name);
  return colours[names.indexOf(name) % colours.length];
};
for (const [id, title, xLabel, yLabel, series] of data) {
  const datasets = series.map(([label, line, dashed, xy], place) => {
    const points = [];
    for (let k = 0; k + 1 < xy.length; k += 2) points.push({x: xy[k], y: xy[k + 1]});
    const colour = colourOf(label);
    return {label, data: points, showLine: line, borderColor: colour, backgroundColor: colour,
            borderWidth: line ? 1.5 : 1, borderDash: dashed ? [5, 4] : [],
            pointStyle: shapes[place % shapes.length],
            pointRadius: line ? 0 : points.length === 1 ? 7 : 2.5};
  });
  new Chart(document.getElementById(id), {
    type: 'scatter',
    data: {datasets},
    options: {
      animation: false, maintainAspectRatio: false, normalized: true,
      interaction: {mode: 'nearest', intersect: false},
      plugins: {title: {display: true, text: title}, legend: {display: datasets.length > 1, labels: {boxWidth: 12}}},
      scales: {x: {title: {display: true, text: xLabel}}, y: {title: {display: true, text: yLabel}}}
    }
  });
}
)";

std::string escaped(std::string_view text) {
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
        out += c;
    }
  }
  return out;
}

// A JavaScript string that cannot end the script element either.
std::string quoted(std::string_view text) {
  constexpr std::string_view kHex = "0123456789abcdef";
  std::string out = "\"";
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte < 0x20 || c == '"' || c == '\\' || c == '<') {
      out += "\\u00";
      out += kHex[byte >> 4];
      out += kHex[byte & 15U];
    } else {
      out += c;
    }
  }
  return out + "\"";
}

void append_number(std::string& out, double value) {
  if (!std::isfinite(value)) {
    out += "null";
    return;
  }
  std::array<char, 32> buffer;
  const auto end = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value,
                                 std::chars_format::general, 6)
                       .ptr;
  out.append(buffer.data(), end);
}

}  // namespace

HtmlPage::HtmlPage(std::string title) : title_(std::move(title)) {}

void HtmlPage::heading(std::string_view text) { body_ += "<h2>" + escaped(text) + "</h2>\n"; }
void HtmlPage::paragraph(std::string_view text) { body_ += "<p>" + escaped(text) + "</p>\n"; }

void HtmlPage::table(const std::vector<std::string>& header,
                     const std::vector<std::vector<std::string>>& rows) {
  const auto row = [&](const char* cell, const std::vector<std::string>& cells) {
    body_ += "<tr>";
    for (const std::string& each : cells) {
      body_ += "<" + std::string(cell) + ">" + escaped(each) + "</" + cell + ">";
    }
    body_ += "</tr>\n";
  };
  body_ += "<div class=\"table\"><table>\n";
  row("th", header);
  for (const auto& each : rows) row("td", each);
  body_ += "</table></div>\n";
}

void HtmlPage::charts(const std::vector<Chart>& charts) {
  body_ += "<div class=\"charts\">\n";
  for (const Chart& chart : charts) {
    const std::string id = "chart" + std::to_string(++count_);
    body_ += "<div class=\"chart\"><canvas id=\"" + id + "\"></canvas></div>\n";
    data_ += "[" + quoted(id) + "," + quoted(chart.title) + "," + quoted(chart.x_label) + "," +
             quoted(chart.y_label) + ",[";
    for (const Series& series : chart.series) {
      data_ += "[" + quoted(series.name) + (series.line ? ",true" : ",false") +
               (series.dashed ? ",true,[" : ",false,[");
      for (std::size_t i = 0; i < series.x.size(); ++i) {
        append_number(data_, series.x[i]);
        data_ += ',';
        append_number(data_, series.y[i]);
        data_ += ',';
      }
      data_ += "]],";
    }
    data_ += "]],\n";
  }
  body_ += "</div>\n";
}

std::string HtmlPage::text() const {
  std::string out =
      "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n<meta name=\"viewport\" "
      "content=\"width=device-width\">\n<title>" +
      escaped(title_) + "</title>\n<style>" + std::string(kStyle) +
      "</style>\n</head><body>\n<h1>" + escaped(title_) + "</h1>\n" + body_;
  if (count_ > 0) {
    out += "<script>" + std::string(chart_js()) + "</script>\n<script>\nconst data = [\n" + data_ +
           "];" + std::string(kScript) + "</script>\n";
  }
  return out + "</body></html>\n";
}

}  // namespace beltgrip::report
