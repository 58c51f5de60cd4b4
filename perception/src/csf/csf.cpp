// The one interface to the closed forms: names, domain, and what gives eccentricity and motion to models that know
// neither.
#include <unseen/perception/csf.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include <unseen/perception/internal/motion.h>
#include <unseen/vdtree/internal/errors.h>

#include "csf/csf_model.h"

namespace unseen::perception {
namespace {

constexpr std::array<std::string_view, csf_models.size()> names = {
    "castle",      "stela",           "daly",      "barten-1989",      "barten-1999",         "barten-fitted",
    "barten-2004", "mannos-sakrison", "rushmeier", "castle-red-green", "castle-yellow-violet"};

// W. Geisler, J. Perry, "A real-time foveated multiresolution system for low-bandwidth video communication", SPIE 3299,
// 1998: threshold contrast grows as exp(0.106 rho (e + 2.3) / 2.3), relative to the fovea as exp(0.106 rho e / 2.3).
constexpr double geisler_perry_alpha = 0.106, geisler_perry_half_degrees = 2.3;
constexpr double geisler_perry_decay = geisler_perry_alpha / geisler_perry_half_degrees / std::numbers::ln10;

bool in_domain(const Stimulus& s) {
    const auto positive = [](double v) { return v > 0 && std::isfinite(v); };
    const auto not_negative = [](double v) { return v >= 0 && std::isfinite(v); };
    return positive(s.frequency.value()) && positive(s.luminance.value()) && positive(s.area.value()) &&
           positive(s.distance.value()) && not_negative(s.eccentricity.value()) && not_negative(s.temporal.value()) &&
           not_negative(s.velocity.value()) && (s.temporal.value() == 0 || s.velocity.value() == 0);
}

double static_at_fovea(CsfModel model, const Stimulus& s) {
    return is_castle_family(model) ? castle_family_at_fovea(model, s) : classical_at_fovea(model, s);
}

} // namespace

std::string_view name(CsfModel model) { return names[static_cast<std::size_t>(model)]; }

Result<CsfModel> csf_model(std::string_view text) {
    std::string known;
    for (const CsfModel model : csf_models) {
        if (text == name(model)) return model;
        known.append(known.empty() ? "" : model == csf_models.back() ? " or " : ", ").append(name(model));
    }
    return invalid_argument("there is no contrast sensitivity model \"" + std::string(text) + "\": use " + known);
}

bool is_achromatic(CsfModel model) {
    return model != CsfModel::castle_red_green && model != CsfModel::castle_yellow_violet;
}

double decay_per_degree(CsfModel model, CyclesPerDegree frequency, VisualField field) {
    if (is_castle_family(model)) return castle_family_decay(model, frequency, field);
    if (model == CsfModel::barten_fitted) return castle_family_decay(CsfModel::castle, frequency, field);
    return geisler_perry_decay * frequency.value();
}

double motion_factor(CsfModel model, const Stimulus& s) {
    if (s.velocity.value() > 0) return velocity_factor(s.frequency, s.velocity);
    if (is_castle_family(model) || s.temporal.value() == 0) return 1;
    return velocity_factor(s.frequency, DegreesPerSecond(s.temporal.value() / s.frequency.value()));
}

std::vector<CyclesPerDegree> kinks(CsfModel model, const Stimulus& conditions) {
    if (is_castle_family(model)) {
        if (conditions.field != VisualField::worst) return {};
        return {equal_decay_frequency(model)};
    }
    if (conditions.temporal.value() == 0) return {};
    return {CyclesPerDegree(conditions.temporal.value() / least_velocity.value())};
}

double sensitivity(CsfModel model, const Stimulus& s) {
    if (!in_domain(s)) return std::numeric_limits<double>::quiet_NaN();
    if (model == CsfModel::daly) return std::min(daly_ceiling(s), daly_eccentric(s)) * motion_factor(model, s);
    const double loss = decay_per_degree(model, s.frequency, s.field) * s.eccentricity.value();
    return static_at_fovea(model, s) * motion_factor(model, s) * std::pow(10.0, -loss);
}

SquareDegrees patch_area(CyclesPerDegree frequency) {
    const double radius_deg = 1.5 / frequency.value();
    return SquareDegrees(std::numbers::pi * radius_deg * radius_deg);
}

namespace {

// R squared.
double castle_area_gain(CyclesPerDegree frequency, SquareDegrees area) {
    const double whole = castle_summation_area(frequency).value(), usual = patch_area(frequency).value();
    return (1 + whole / usual) / (1 + whole / area.value());
}

bool is_patch(CyclesPerDegree frequency, SquareDegrees area) { return frequency.value() > 0 && area.value() > 0; }

} // namespace

double summation_share(CyclesPerDegree frequency, SquareDegrees area) {
    if (!is_patch(frequency, area)) return std::numeric_limits<double>::quiet_NaN();
    const SquareDegrees unlimited(std::numeric_limits<double>::infinity());
    const double all = std::log(castle_area_gain(frequency, unlimited));
    return std::max(0.0, std::log(castle_area_gain(frequency, area)) / all);
}

double summation_gain(CyclesPerDegree frequency, SquareDegrees area, double own) {
    if (!is_patch(frequency, area) || !(own > 0)) return std::numeric_limits<double>::quiet_NaN();
    return std::sqrt(castle_area_gain(frequency, area)) * std::pow(own, summation_share(frequency, area));
}

Stimulus stimulus_of(const Stimulus& conditions, CyclesPerDegree frequency, Degrees eccentricity, Luminance luminance) {
    Stimulus s = conditions;
    s.frequency = frequency, s.eccentricity = eccentricity, s.luminance = luminance, s.area = patch_area(frequency);
    return s;
}

namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

bool in_domain(double cpd, double deg_s) { return cpd > 0 && std::isfinite(cpd) && deg_s >= 0 && std::isfinite(deg_s); }

// Laird et al. 2006.
constexpr double spatial = 0.8404, speed = 0.7986;

// log k(v).
double log_gain(double deg_s) {
    const double decades = std::abs(std::log10(speed * deg_s / 3));
    return std::log(6.1 + 7.3 * decades * decades * decades);
}

double clamped(DegreesPerSecond velocity) { return std::max(velocity.value(), least_velocity.value()); }

} // namespace

double velocity_factor(CyclesPerDegree frequency, DegreesPerSecond velocity) {
    if (!in_domain(frequency.value(), velocity.value())) return nan;
    const double deg_s = clamped(velocity), least = least_velocity.value();
    if (deg_s == least) return 1; // one expression below, which holds where S underflows
    const double wave = 2 * std::numbers::pi * spatial * frequency.value();
    const double rise = log_gain(deg_s) - log_gain(least) + std::log(deg_s / least);
    return std::exp(rise - 2 * wave * speed * (deg_s - least) / 45.9);
}

Result<Person> person(std::string_view wanted) {
    std::string names;
    for (const Person& p : people) {
        if (p.name == wanted) return p;
        names += (names.empty() ? "" : ", ") + std::string(p.name);
    }
    return invalid_argument("'" + std::string(wanted) + "' is no observer; there are: " + names + ".");
}

std::shared_ptr<const CsfTable> csf_of(const Person& person) {
    const auto made = [](double gain) {
        Result<CsfTable> table = CsfTable::standard().scaled(gain);
        assert(table && "the gain is in its range");
        return std::make_shared<const CsfTable>(*std::move(table));
    };
    static const auto median = made(median_person.gain), usual = made(default_person.gain),
                      strict = made(strict_person.gain);
    for (const auto& [known, table] :
         {std::pair{median_person, median}, {default_person, usual}, {strict_person, strict}})
        if (person.gain == known.gain) return table;
    return made(person.gain);
}

} // namespace unseen::perception
