#include "output_files.h"

#include <algorithm>
#include <filesystem>
#include <iterator>

#include <unseen/vdtree/internal/atomic_file.h>

#include "report.h"
#include "terminal.h"

namespace unseen::app {

namespace fs = std::filesystem;

namespace {

std::vector<std::string> checked_outputs; // of this run
std::vector<fs::path> made_folders;       // parents first

bool is_file(const std::string& name) { return !name.empty() && name != "-"; }

bool is_same(const std::string& a, const std::string& b) {
    if (!is_file(a) || !is_file(b)) return false;
    std::error_code unknown;
    if (fs::equivalent(a, b, unknown)) return true;
    const fs::path one = fs::weakly_canonical(fs::absolute(a, unknown), unknown),
                   other = fs::weakly_canonical(fs::absolute(b, unknown), unknown);
    return !one.empty() && one == other;
}

Result<void> make_folder(const fs::path& folder) {
    std::error_code failure;
    if (folder.empty() || fs::is_directory(folder, failure)) return {};
    if (const auto parent = make_folder(folder.parent_path()); !parent) return parent;
    if (fs::create_directory(folder, failure)) made_folders.push_back(folder);
    if (!failure) return {};
    return Error{ErrorCode::io_failure, "Cannot make the folder '" + folder.string() + "': " + failure.message() + "."};
}

} // namespace

Result<std::optional<vdtree::AtomicFile>> open_if_named(const std::string& file) {
    if (file.empty()) return std::optional<vdtree::AtomicFile>();
    auto opened = vdtree::AtomicFile::create(file);
    if (!opened) return opened.error();
    vdtree::AtomicFile::remove_orphans(file);
    return std::optional(std::move(*opened));
}

std::vector<std::string> inputs_of(const std::string& model, const ViewOptions& view, const DisplayOptions& display) {
    return {model, view.lights, view.texture.file, display.file, display.observer, display.csf};
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
        if (const auto made = make_folder(fs::path(*output).parent_path()); !made) return made;
        if (const auto file = vdtree::AtomicFile::create(*output); !file) return file.error(); // goes without a trace
        checked_outputs.push_back(*output);
    }
    return {};
}

void print_written(const std::vector<std::string>& files) {
    for (const std::string& file : files) {
        if (!is_file(file)) continue;
        std::error_code unknown;
        const std::uintmax_t bytes = fs::file_size(file, unknown);
        print_line("wrote " + file + (unknown ? "" : " (" + file_size(bytes) + ")"));
    }
}

std::vector<std::string> written_outputs() {
    std::vector<std::string> files;
    std::copy_if(checked_outputs.begin(), checked_outputs.end(), std::back_inserter(files),
                 [](const std::string& file) {
                     std::error_code unknown;
                     return fs::exists(file, unknown);
                 });
    return files;
}

void remove_empty_made_folders() {
    std::error_code ignored;
    for (auto folder = made_folders.rbegin(); folder != made_folders.rend(); ++folder) fs::remove(*folder, ignored);
}

} // namespace unseen::app
