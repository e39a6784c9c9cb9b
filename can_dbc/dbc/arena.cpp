#include "can_dbc/dbc/arena.h"

namespace beltgrip::can {

namespace {
// Chosen: small enough that the DBC of a daemon, some messages, costs no more; what is larger gets
// a block of its own.
constexpr std::size_t kBlockFirst = std::size_t{4} * 1024;
constexpr std::size_t kBlockMost = std::size_t{256} * 1024;
}  // namespace

std::byte* Arena::take(std::size_t bytes) {
  bytes = (bytes + kAlignment - 1) / kAlignment * kAlignment;
  if (bytes > left_) {
    // Each twice the one before, so that their number does not grow with the file.
    const std::size_t usual =
        std::min(kBlockMost, kBlockFirst << std::min<std::size_t>(blocks_.size(), 6));
    if (bytes > usual / 4) {
      blocks_.push_back(std::make_unique_for_overwrite<std::byte[]>(bytes));
      return blocks_.back().get();
    }
    blocks_.push_back(std::make_unique_for_overwrite<std::byte[]>(usual));
    free_ = blocks_.back().get();
    left_ = usual;
  }
  std::byte* const taken = free_;
  free_ += bytes;
  left_ -= bytes;
  return taken;
}

Text Arena::keep(std::string_view text) {
  if (text.empty()) return {};
  auto* const place = reinterpret_cast<char*>(take(text.size()));
  std::copy(text.begin(), text.end(), place);
  return Text(std::string_view(place, text.size()));
}

Text Arena::keep_whole(std::string&& text) {
  texts_.push_back(std::make_unique<const std::string>(std::move(text)));
  return Text(*texts_.back());
}

}  // namespace beltgrip::can
