// Where a database keeps what its file says: text as pieces of the file itself, lists as arrays of
// plain values, all of it in a few large blocks that go together. A hundred thousand signals then
// cost no allocation each, and nothing to give back.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <new>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

namespace beltgrip::can {

// Text that something else keeps: an arena, or the program itself (a literal). Reads like a string
// and becomes one where somebody wants to have it for himself; a string does not become a Text, for
// nobody would say how long it lives: Arena::keep does.
class Text : public std::string_view {
 public:
  constexpr Text() = default;
  constexpr Text(const char* literal) : std::string_view(literal) {}
  constexpr explicit Text(std::string_view kept) : std::string_view(kept) {}
  operator std::string() const { return {data(), size()}; }

  friend std::string operator+(std::string left, Text right) { return left.append(right); }
  friend std::string operator+(Text left, std::string_view right) {
    return std::string(left).append(right);
  }
  friend std::string operator+(const char* left, Text right) {
    return std::string(left).append(right);
  }
  friend std::string operator+(Text left, char right) { return std::string(left) + right; }
  friend std::string operator+(char left, Text right) { return std::string(1, left).append(right); }
};

// The same in one word instead of two, for text that is seldom there or that many have alike.
class ShortText {
 public:
  constexpr ShortText() = default;
  operator Text() const noexcept { return text_ == nullptr ? Text() : *text_; }
  operator std::string() const { return Text(*this); }
  std::size_t size() const noexcept { return text_ == nullptr ? 0 : text_->size(); }
  bool empty() const noexcept { return size() == 0; }
  friend bool operator==(ShortText left, std::string_view right) { return Text(left) == right; }
  friend std::string operator+(std::string left, ShortText right) {
    return std::move(left) + Text(right);
  }
  friend std::string operator+(char left, ShortText right) { return left + Text(right); }

 private:
  friend class Arena;
  explicit ShortText(const Text* text) : text_(text) {}
  const Text* text_ = nullptr;
};

// A list that an arena keeps: it is not changed, and a copy of it is the same list.
template <typename T>
class List {
  static_assert(std::is_trivially_destructible_v<T>, "an arena gives memory back, nothing more");

 public:
  using value_type = T;
  constexpr List() = default;

  std::size_t size() const noexcept { return block_ == nullptr ? 0 : block_->size; }
  bool empty() const noexcept { return size() == 0; }
  const T* begin() const noexcept {
    return block_ == nullptr ? nullptr : reinterpret_cast<const T*>(block_ + 1);
  }
  const T* end() const noexcept { return begin() + size(); }
  const T& operator[](std::size_t i) const noexcept { return begin()[i]; }
  const T& back() const noexcept { return end()[-1]; }
  friend bool operator==(List a, List b) {
    return a.block_ == b.block_ || a == std::span<const T>(b.begin(), b.end());
  }
  friend bool operator==(List a, std::span<const T> b) {
    return std::equal(a.begin(), a.end(), b.begin(), b.end());
  }

 private:
  friend class Arena;
  // One word in the signal, and the number of entries in front of them.
  struct alignas(8) Block {
    std::size_t size;
  };
  explicit List(const Block* block) : block_(block) {}
  const Block* block_ = nullptr;
};

// The same with a key each, sorted by it.
template <typename Key, typename Value>
class Table : public List<std::pair<Key, Value>> {
  using Entries = List<std::pair<Key, Value>>;

 public:
  constexpr Table() = default;

  const std::pair<Key, Value>* find(Key key) const noexcept {
    const auto* at = std::lower_bound(
        this->begin(), this->end(), key,
        [](const std::pair<Key, Value>& entry, Key wanted) { return entry.first < wanted; });
    return at != this->end() && at->first == key ? at : this->end();
  }
  bool contains(Key key) const noexcept { return find(key) != this->end(); }
  Value at(Key key) const {
    const auto* found = find(key);
    if (found == this->end()) throw std::out_of_range("no such key");
    return found->second;
  }

 private:
  friend class Arena;
  explicit Table(Entries sorted) : Entries(sorted) {}
};

class Arena {
 public:
  Text keep(std::string_view text);
  // Takes over all of it.
  Text keep_whole(std::string&& text);

  template <typename T>
  List<T> list(std::span<const T> entries) {
    if (entries.empty()) return {};
    using Block = typename List<T>::Block;
    static_assert(alignof(T) <= alignof(Block));
    std::byte* const place = take(sizeof(Block) + entries.size_bytes());
    const auto* const block = new (place) Block{entries.size()};
    std::uninitialized_copy(entries.begin(), entries.end(),
                            reinterpret_cast<T*>(place + sizeof(Block)));
    return List<T>(block);
  }
  template <typename T>
  List<T> list(const std::vector<T>& entries) {
    return list(std::span<const T>(entries));
  }
  // entries: sorted, each key once.
  template <typename Key, typename Value>
  Table<Key, Value> table(const std::vector<std::pair<Key, Value>>& entries) {
    return Table<Key, Value>(list(entries));
  }
  ShortText shorten(Text kept) { return kept.empty() ? ShortText() : ShortText(one(kept)); }
  template <typename T>
  const T* one(const T& value) {
    static_assert(std::is_trivially_destructible_v<T> && alignof(T) <= kAlignment);
    return new (take(sizeof(T))) T(value);
  }

 private:
  static constexpr std::size_t kAlignment = 8;
  std::byte* take(std::size_t bytes);

  std::vector<std::unique_ptr<std::byte[]>> blocks_;
  std::vector<std::unique_ptr<const std::string>> texts_;  // taken over: they stay where they are
  std::byte* free_ = nullptr;
  std::size_t left_ = 0;
};

}  // namespace beltgrip::can
