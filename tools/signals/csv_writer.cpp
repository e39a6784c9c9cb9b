#include <charconv>
#include <cmath>

#include "tools/signals/signal_writer.h"
#include "tools/text/seconds.h"

namespace beltgrip::signals {

namespace {

class CsvWriter final : public SignalWriter {
 public:
  CsvWriter(std::FILE* out, const std::vector<Signal>& signals) : out_(out) {
    line_ = "t[s]";
    for (const Signal& signal : signals) {
      line_ += ',' + signal.name;
      if (!signal.unit.empty()) line_ += '[' + signal.unit + ']';
    }
    put();
  }

  void row(std::int64_t t_ns, std::span<const double> values) override {
    line_ = text::seconds_text(t_ns);
    for (const double value : values) {
      line_ += ',';
      if (!std::isfinite(value)) continue;
      char number[32];
      line_.append(number, std::to_chars(number, number + sizeof number, value).ptr);
    }
    put();
  }

  void finish() override {}

 private:
  void put() {
    line_ += '\n';
    std::fwrite(line_.data(), 1, line_.size(), out_);
  }

  std::FILE* out_;
  std::string line_;
};

}  // namespace

std::unique_ptr<SignalWriter> make_csv_writer(std::FILE* out, const std::vector<Signal>& signals) {
  return std::make_unique<CsvWriter>(out, signals);
}

}  // namespace beltgrip::signals
