// A report as one HTML file that needs nothing beside it: text, tables and plots, the libraries
// that draw the plots included. Tools only.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "tools/report/courses.h"

namespace beltgrip::report {

struct Series {
  std::string name;
  std::vector<double> x, y;  // same length; what is not finite is a gap
  bool line = false;         // else points
  bool dashed = false;
  bool band = false;  // shaded from the series before it, which is drawn only for this: no name
};

struct Chart {
  std::string title, x_label, y_label;
  std::vector<Series> series;
};

class HtmlPage {
 public:
  explicit HtmlPage(std::string title);
  void heading(std::string_view text);
  void paragraph(std::string_view text);
  void table(const std::vector<std::string>& header,
             const std::vector<std::vector<std::string>>& rows);
  void charts(const std::vector<Chart>& charts);  // side by side as far as there is room
  void courses(const Courses& courses);
  void beside(const std::vector<Chart>& left, const Courses& right);
  std::string text() const;  // the whole file

 private:
  std::string title_, body_, curves_, courses_;
  int count_ = 0;
};

}  // namespace beltgrip::report
