#include "output_files.h"

#include <algorithm>
#include <filesystem>

#include <vdtree/internal/atomic_file.h>

namespace unseen::app {

namespace fs = std::filesystem;

namespace {

bool is_file(const std::string& name) { return !name.empty() && name != "-"; }

bool is_same(const std::string& a, const std::string& b) {
    if (!is_file(a) || !is_file(b)) return false;
    std::error_code unknown;
    if (fs::equivalent(a, b, unknown)) return true;
    const fs::path one = fs::weakly_canonical(fs::absolute(a, unknown), unknown),
                   other = fs::weakly_canonical(fs::absolute(b, unknown), unknown);
    return !one.empty() && one == other;
}

} // namespace

std::vector<std::string> inputs_of(const std::string& model, const ViewOptions& view, const DisplayOptions& display) {
    return {model, view.lights, view.texture.file, display.file, display.csf};
}

Result<void> check_outputs(const std::vector<std::string>& inputs, const std::vector<std::string>& outputs) {
    for (auto output = outputs.begin(); output != outputs.end(); ++output) {
        if (std::any_of(inputs.begin(), inputs.end(),
                        [&](const std::string& input) { return is_same(input, *output); }))
            return Error{ErrorCode::invalid_argument, "'" + *output + "' is read: give the output another name."};
        if (std::any_of(outputs.begin(), output, [&](const std::string& other) { return is_same(other, *output); }))
            return Error{ErrorCode::invalid_argument,
                         "'" + *output + "' is named for two outputs: give each a name of its own."};
        if (!is_file(*output)) continue;
        if (const auto file = vdtree::AtomicFile::create(*output); !file) return file.error(); // goes without a trace
    }
    return {};
}

} // namespace unseen::app
