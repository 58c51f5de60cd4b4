#include "output_files.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <filesystem>
#include <iterator>

#include <unistd.h>

#include <unseen/session/load.h>
#include <unseen/vdtree/internal/atomic_file.h>
#include <unseen/vdtree/tree_io.h>

#include "terminal.h"

namespace unseen::app {

namespace fs = std::filesystem;

namespace {

std::vector<std::string> checked_inputs, checked_outputs; // of this run

// Parents first. A signal's handler may read them at any time; folders beyond these are left.
std::array<fs::path, 64> made_folders;
std::atomic<std::size_t> made_folder_count = 0;

bool is_file(const std::string& name) { return !name.empty() && name != "-"; }

bool is_same(const std::string& a, const std::string& b) {
    if (!is_file(a) || !is_file(b)) return false;
    std::error_code unknown;
    if (fs::equivalent(a, b, unknown)) return true;
    const fs::path one = fs::weakly_canonical(fs::absolute(a, unknown), unknown),
                   other = fs::weakly_canonical(fs::absolute(b, unknown), unknown);
    return !one.empty() && one == other;
}

// Whether the file is one of the numbered pictures that the output names ("frames/%04d.png").
bool is_picture_of(const fs::path& file, const fs::path& output) {
    const std::string name = file.filename().string(), pattern = output.filename().string();
    const std::size_t begin = pattern.find('%'), end = pattern.find('d', begin);
    if (begin == pattern.npos || end == pattern.npos || !is_same(file.parent_path() / ".", output.parent_path() / "."))
        return false;
    const std::string after = pattern.substr(end + 1);
    if (name.size() <= begin + after.size() || !name.starts_with(pattern.substr(0, begin)) || !name.ends_with(after))
        return false;
    const std::string number = name.substr(begin, name.size() - begin - after.size());
    return number.find_first_not_of("0123456789") == number.npos;
}

// Whether an input is a mesh that reads the output: a buffer, a library of materials, an image.
bool is_read_by(const std::string& input, const std::string& output) {
    std::error_code unknown;
    const bool may_be_there = fs::exists(output, unknown) || output.find('%') != output.npos;
    if (!is_file(input) || !is_file(output) || !may_be_there || vdtree::is_tree_file(input)) return false;
    const auto named = session::files_named_by(input);
    return std::any_of(named.begin(), named.end(), [&](const fs::path& file) {
        return is_same(file.string(), output) || is_picture_of(file, output);
    });
}

Result<void> make_folder(const fs::path& folder) {
    std::error_code failure;
    if (folder.empty() || fs::is_directory(folder, failure)) return {};
    if (const auto parent = make_folder(folder.parent_path()); !parent) return parent;
    const std::size_t place = made_folder_count;
    if (place < made_folders.size()) {
        made_folders[place] = folder;
        made_folder_count = place + 1; // before it is there: a signal may come at any time
    }
    if (!fs::create_directory(folder, failure)) made_folder_count = place;
    if (!failure) return {};
    return Error{ErrorCode::io_failure, "Cannot make the folder '" + folder.string() + "': " + failure.message() + "."};
}

} // namespace

std::vector<std::string> inputs_of(const std::string& model, const ViewOptions& view, const DisplayOptions& display) {
    std::vector<std::string> files = {model,        view.setup,       view.lights, view.texture.file,
                                      display.file, display.observer, display.csf};
    for (const session::Protection& protection : view.texture.protect)
        if (protection.kind == session::Protection::Kind::vertices) files.push_back(protection.name);
    return files;
}

Message with_file_name(const Error& error) {
    const auto is_named = [&](const std::string& input) {
        return is_file(input) && error.message.find(fs::path(input).filename().string()) != std::string::npos;
    };
    if (error.code != ErrorCode::malformed_data || checked_inputs.empty() ||
        std::any_of(checked_inputs.begin(), checked_inputs.end(), is_named))
        return error.message;
    return checked_inputs.front() + ": " + error.message;
}

Result<void> check_outputs(const std::vector<std::string>& inputs, const std::vector<std::string>& outputs) {
    checked_inputs = inputs;
    for (auto output = outputs.begin(); output != outputs.end(); ++output) {
        if (std::any_of(inputs.begin(), inputs.end(), [&](const std::string& input) {
                return is_same(input, *output) || is_read_by(input, *output);
            }))
            return Error{ErrorCode::invalid_argument, "'" + *output + "' is read: give the output another name."};
        if (std::any_of(outputs.begin(), output, [&](const std::string& other) { return is_same(other, *output); }))
            return Error{ErrorCode::invalid_argument,
                         "'" + *output + "' is named for two outputs: give each a name of its own."};
        if (!is_file(*output)) continue;
        if (const auto made = make_folder(fs::path(*output).parent_path()); !made) return made;
        if (const auto file = vdtree::AtomicFile::create(*output); !file) return file.error(); // goes without a trace
        vdtree::AtomicFile::remove_orphans(*output);
        checked_outputs.push_back(*output);
    }
    return {};
}

Result<JsonReport> open_report(const std::vector<std::string>& inputs, std::vector<std::string> outputs,
                               const std::string& json, const std::string& csv) {
    outputs.insert(outputs.end(), {csv, json});
    if (const auto ready = check_outputs(inputs, outputs); !ready) return ready.error();
    return JsonReport::open(json, csv);
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

void remove_empty_made_folders() noexcept {
    for (std::size_t i = made_folder_count; i-- > 0;) ::rmdir(made_folders[i].c_str());
}

} // namespace unseen::app
