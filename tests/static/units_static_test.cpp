// What units must not let through, checked by the compiler: no implicit way from a number to a quantity, from a
// quantity to a number, or from one unit to another.
#include <concepts>
#include <type_traits>

#include <unseen/perception/units.h>

namespace unseen::perception {
namespace {

template <class A, class B>
concept can_add = requires(A a, B b) {
    a + b;
};
template <class A, class B>
concept can_subtract = requires(A a, B b) {
    a - b;
};
template <class A, class B>
concept can_multiply = requires(A a, B b) {
    a* b;
};
template <class A, class B>
concept can_divide = requires(A a, B b) {
    a / b;
};
template <class A, class B>
concept can_compare = requires(A a, B b) {
    a < b;
};
template <class A, class B>
concept can_equate = requires(A a, B b) {
    a == b;
};
template <class A, class B>
concept can_assign = requires(A a, B b) {
    a = b;
};

// Degrees and radians, the mix-up that costs most.
static_assert(!std::convertible_to<Degrees, Radians> && !std::convertible_to<Radians, Degrees>);
static_assert(!std::is_constructible_v<Radians, Degrees> && !std::is_constructible_v<Degrees, Radians>);
static_assert(!can_assign<Radians&, Degrees>);
static_assert(!can_add<Degrees, Radians> && !can_subtract<Degrees, Radians> && !can_compare<Degrees, Radians>);
static_assert(!can_equate<Degrees, Radians> && !can_divide<Degrees, Radians>);

// Numbers: explicit in, value() out.
static_assert(std::is_constructible_v<Degrees, double> && !std::convertible_to<double, Degrees>);
static_assert(!std::convertible_to<int, Metres> && !can_assign<Metres&, double>);
static_assert(!std::convertible_to<Degrees, double> && !std::is_constructible_v<double, Degrees>);
static_assert(!std::is_constructible_v<bool, Luminance>);
static_assert(!can_add<Degrees, double> && !can_compare<Degrees, double> && !can_equate<Luminance, double>);
static_assert(std::same_as<decltype(Degrees{}.value()), double>);

// Units of the same dimension in other clothes stay apart too.
static_assert(!std::convertible_to<PixelsPerDegree, CyclesPerDegree> && !can_add<CyclesPerDegree, PixelsPerDegree>);
static_assert(!std::convertible_to<Lux, Luminance> && !can_compare<Lux, Luminance>);
static_assert(!std::convertible_to<Degrees, SquareDegrees>);

// Only meaningful arithmetic: scaling, sums and ratios of one unit, but no products of quantities.
static_assert(std::same_as<decltype(Degrees{} + Degrees{}), Degrees>);
static_assert(std::same_as<decltype(2.0 * Degrees{} / 3.0), Degrees>);
static_assert(std::same_as<decltype(Metres{1} / Metres{2}), double>);
static_assert(!can_multiply<Degrees, Degrees> && !can_multiply<Luminance, Metres>);
static_assert(!can_divide<double, Degrees>);
static_assert(can_compare<Degrees, Degrees> && can_equate<Luminance, Luminance>);

// As cheap as the number inside.
static_assert(sizeof(Luminance) == sizeof(double) && std::is_trivially_copyable_v<Luminance>);

} // namespace
} // namespace unseen::perception
