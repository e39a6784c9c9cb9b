// What a page needs beside its text, generated at build: the libraries that draw, as Debian
// packages them, and our own plots.js and page.css. Tools only.
#pragma once

#include <string_view>

namespace beltgrip::report {
std::string_view chart_js();
std::string_view dygraphs_js();
std::string_view dygraphs_css();
std::string_view plots_js();
std::string_view page_css();
}  // namespace beltgrip::report
