// What several statements say about one object, brought together: noted one by one in the order of
// the file, then given out object by object, so that it takes the same time however many there are.
#pragma once

#include <algorithm>
#include <cstddef>
#include <functional>
#include <utility>
#include <vector>

namespace beltgrip::can::dbc {

template <typename Object, typename Said>
class Gathered {
 public:
  // notes: about as many as there will be.
  explicit Gathered(std::size_t notes) { notes_.reserve(notes); }

  void add(Object* object, Said said) { notes_.push_back({object, std::move(said)}); }

  // take(object, said) with all that was noted of it, in the order in which it was.
  template <typename Take>
  void give(Take take) {
    const auto before = [](const Note& a, const Note& b) {
      return std::less<Object*>()(a.object, b.object);
    };
    if (!std::is_sorted(notes_.begin(), notes_.end(), before)) {
      std::stable_sort(notes_.begin(), notes_.end(), before);
    }
    std::vector<Said> own;
    for (std::size_t i = 0; i < notes_.size();) {
      Object* const object = notes_[i].object;
      own.clear();
      for (; i < notes_.size() && notes_[i].object == object; ++i) {
        own.push_back(std::move(notes_[i].said));
      }
      take(*object, own);
    }
    notes_.clear();
  }

 private:
  struct Note {
    Object* object;
    Said said;
  };
  std::vector<Note> notes_;
};

}  // namespace beltgrip::can::dbc
