#include "targets.h"

#include <stdexcept>

#include <nlohmann/json.hpp>

#include <unseen/vdtree/internal/input_file.h>

#include "embedded.h"

namespace unseen::app {
namespace {

std::string key_of(std::string_view bench, std::string_view figure) {
    return std::string(bench) + "/" + std::string(figure);
}

// Nothing but numbers named must and aim.
std::optional<Target> target_of(const nlohmann::json& json) {
    if (!json.is_object()) return std::nullopt;
    Target target;
    for (const auto& [name, value] : json.items()) {
        if (!value.is_number() || (name != "must" && name != "aim")) return std::nullopt;
        (name == "must" ? target.must : target.aim) = value.get<double>();
    }
    return target;
}

} // namespace

Result<Targets> Targets::parse(std::string_view text, const std::string& name) {
    const auto malformed = [&](const std::string& what) {
        return Error{ErrorCode::malformed_data, name + ": " + what};
    };
    const auto json = nlohmann::json::parse(text, nullptr, false);
    if (!json.is_object()) return malformed("is no JSON object of targets; apps/bench/targets.json is one.");
    Targets targets;
    for (const auto& [bench, figures] : json.items()) {
        if (!figures.is_object()) return malformed("'" + bench + "' is no object of figures.");
        for (const auto& [figure, value] : figures.items()) {
            const auto target = target_of(value);
            if (!target) return malformed("the target of '" + figure + "' is not like {\"must\": 2, \"aim\": 1}.");
            targets.of_[key_of(bench, figure)] = *target;
        }
    }
    return targets;
}

const Targets& Targets::built_in() {
    static const Targets targets = [] {
        auto parsed = parse(embedded::targets_json, "targets.json");
        if (!parsed) throw std::logic_error(parsed.error().message);
        return std::move(*parsed);
    }();
    return targets;
}

Result<Targets> Targets::read(const std::string& file) {
    if (file.empty()) return built_in();
    const auto text = read_text_file(file);
    if (!text) return text.error();
    auto targets = parse(*text, file);
    if (!targets) return targets;
    for (const auto& [key, target] : targets->of_)
        if (!built_in().of_.contains(key))
            return Error{ErrorCode::malformed_data, file + ": nothing measures '" + key + "'."};
    return targets;
}

Target Targets::of(std::string_view bench, std::string_view figure) const {
    const std::string key = key_of(bench, figure);
    built_in().of_.at(key); // throws: a name that is wrong must not pass for a figure without a target
    const auto found = of_.find(key);
    return found == of_.end() ? Target() : found->second;
}

} // namespace unseen::app
