#include "tools/report/html_page.h"

#include "tools/report/embedded.h"
#include "tools/report/script_text.h"

namespace beltgrip::report {

HtmlPage::HtmlPage(std::string title) : title_(std::move(title)) {}

void HtmlPage::heading(std::string_view text) { body_ += "<h2>" + escaped(text) + "</h2>\n"; }
void HtmlPage::paragraph(std::string_view text) { body_ += "<p>" + marked_up(text) + "</p>\n"; }

void HtmlPage::table(const std::vector<std::string>& header,
                     const std::vector<std::vector<std::string>>& rows) {
  const auto row = [&](const char* cell, const std::vector<std::string>& cells) {
    body_ += "<tr>";
    for (const std::string& each : cells) {
      body_ += "<" + std::string(cell) + ">" + marked_up(each) + "</" + cell + ">";
    }
    body_ += "</tr>\n";
  };
  body_ += "<div class=\"table\"><table>\n";
  row("th", header);
  for (const auto& each : rows) row("td", each);
  body_ += "</table></div>\n";
}

// A chart is [id, title, x label, y label, series], a series [name, is a line, is dashed, is a
// band, [x, y, x, y, ...]].
void HtmlPage::charts(const std::vector<Chart>& charts) {
  body_ += "<div class=\"charts\">\n";
  for (const Chart& chart : charts) {
    const std::string id = "plot" + std::to_string(++count_);
    body_ += "<div class=\"chart\"><canvas id=\"" + id + "\"></canvas></div>\n";
    curves_ += "[" + quoted(id) + "," + quoted(chart.title) + "," + quoted(chart.x_label) + "," +
               quoted(chart.y_label) + ",[";
    for (const Series& series : chart.series) {
      curves_ += "[" + quoted(series.name);
      for (const bool is : {series.line, series.dashed, series.band}) {
        curves_ += is ? ",true" : ",false";
      }
      curves_ += ",[";
      for (std::size_t i = 0; i < series.x.size(); ++i) {
        append_number(curves_, series.x[i]);
        curves_ += ',';
        append_number(curves_, series.y[i]);
        curves_ += ',';
      }
      curves_ += "]],";
    }
    curves_ += "]],\n";
  }
  body_ += "</div>\n";
}

void HtmlPage::courses(const Courses& courses) {
  const std::string id = "plot" + std::to_string(++count_);
  body_ += "<div class=\"courses\" id=\"" + id + "\"></div>\n";
  courses_ += courses_script(id, courses) + ",\n";
}

void HtmlPage::beside(const std::vector<Chart>& left, const Courses& right) {
  body_ += "<div class=\"beside\">\n";
  charts(left);
  courses(right);
  body_ += "</div>\n";
}

std::string HtmlPage::text() const {
  const auto script = [](std::string_view text) {
    return "<script>" + std::string(text) + "</script>\n";
  };
  std::string out =
      "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n<meta name=\"viewport\" "
      "content=\"width=device-width\">\n<title>" +
      escaped(title_) + "</title>\n<style>" + std::string(dygraphs_css()) +
      std::string(page_css()) + "</style>\n</head><body>\n<h1>" + escaped(title_) + "</h1>\n" +
      body_;
  if (count_ > 0) {
    out += script(chart_js()) + script(dygraphs_js()) +
           script("\nconst curves = [\n" + curves_ + "];\nconst courses = [\n" + courses_ + "];\n" +
                  std::string(plots_js()));
  }
  return out + "</body></html>\n";
}

}  // namespace beltgrip::report
