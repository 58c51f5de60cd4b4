// What is promised of the figures that benchmarks measure: targets.json, which is compiled in, or a file in its place.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>

#include <unseen/vdtree/result.h>

namespace unseen::app {

// What a figure has to reach, and what would be better still; both in its own unit.
struct Target {
    std::optional<double> must, aim;
};

class Targets {
public:
    static const Targets& built_in();

    // {"engine": {"still view, us": {"must": 1, "aim": 0.1}, ...}, ...}; empty: those that are built in. Figures that
    // the file leaves out have no target. Fails where it is no such file, and where it names what nothing measures.
    static Result<Targets> read(const std::string& file);

    // Precondition: the figure is in targets.json.
    Target of(std::string_view bench, std::string_view figure) const;

private:
    static Result<Targets> parse(std::string_view text, const std::string& name);

    std::map<std::string, Target, std::less<>> of_; // "bench/figure"
};

} // namespace unseen::app
