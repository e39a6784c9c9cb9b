// What a mutated source calls: an expression as it stands, or changed where its mutant is chosen by
// the environment (BELTGRIP_MUTANT). With BELTGRIP_MUTANTS_REACHED it writes down which were come
// by.
#pragma once

namespace mutant {

bool on(int which) noexcept;

inline bool flip(int which, bool value) noexcept { return value != on(which); }
inline bool decide(int which, bool value) noexcept {  // which: always true; which + 1: always false
  return on(which) || (!on(which + 1) && value);
}
template <class T>
auto scaled(int which, const T& value) noexcept {  // half as much again; which + 1: two thirds
  const bool more = on(which), less = on(which + 1);
  return more   ? static_cast<T>(value + value / 2)
         : less ? static_cast<T>(value - value / 3)
                : value;
}
template <class A, class B>
bool order(int which, char kind, const A& a, const B& b) noexcept {
  const bool edge = on(which);
  switch (kind) {
    case '<':
      return edge ? a <= b : a < b;
    case '>':
      return edge ? a >= b : a > b;
    case 'l':
      return edge ? a < b : a <= b;
    default:
      return edge ? a > b : a >= b;
  }
}
template <class A, class B>
auto sum(int which, const A& a, const B& b) noexcept {
  return on(which) ? a - b : a + b;
}
template <class A, class B>
auto difference(int which, const A& a, const B& b) noexcept {
  return on(which) ? a + b : a - b;
}
template <class A, class B>
auto product(int which, const A& a, const B& b) noexcept {
  return on(which) ? decltype(a * b)(a) : a * b;
}
template <class A, class B>
auto quotient(int which, const A& a, const B& b) noexcept {
  return on(which) ? decltype(a / b)(a) : a / b;
}
struct Least {
  int which;
  template <class T>
  T operator()(const T& a, const T& b) const noexcept {
    return (b < a) != on(which) ? b : a;
  }
};
struct Largest {
  int which;
  template <class T>
  T operator()(const T& a, const T& b) const noexcept {
    return (a < b) != on(which) ? b : a;
  }
};

}  // namespace mutant
