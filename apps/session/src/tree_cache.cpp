#include <unseen/session/load.h>

#include <algorithm>
#include <charconv>
#include <mutex>
#include <system_error>
#include <unordered_map>

#define XXH_INLINE_ALL
#include <xxhash.h>

#include <unseen/vdtree/internal/errors.h>
#include <unseen/vdtree/internal/input_file.h>
#include <unseen/vdtree/internal/number_format.h>
#include <unseen/vdtree/tree_io.h>

namespace unseen::session {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t default_most_bytes = std::uint64_t{4} << 30;
constexpr std::string_view ending = ".vdt";
constexpr std::size_t key_digits = 32, sum_digits = 16;
constexpr std::size_t longest_source = 120; // bytes of a name; with the rest it is shorter than file systems allow

std::string variable(const char* name) {
    const char* value = std::getenv(name);
    return value ? value : "";
}

fs::path folder_of(const CacheOptions& options) {
    if (options.is_off || !options.folder.empty()) return options.is_off ? fs::path() : options.folder;
    if (const std::string own = variable("UNSEEN_CACHE"); !own.empty())
        return own == "off" ? fs::path() : fs::path(own);
    // Folders that are not absolute are not valid there.
    if (const fs::path all = variable("XDG_CACHE_HOME"); all.is_absolute()) return all / "unseen";
    if (const fs::path home = variable("HOME"); home.is_absolute()) return home / ".cache" / "unseen";
    return {};
}

std::uint64_t most_bytes_of(const CacheOptions& options) {
    if (options.most_bytes > 0) return options.most_bytes;
    const auto set = parse_size(variable("UNSEEN_CACHE_SIZE"));
    return set ? *set : default_most_bytes;
}

// Files are called KEY-SUM-SOURCE.vdt. The sum is that of the file's header, in which all its checksums come together:
// by it, a tree that lies under the key of another mesh is found out.
std::string sum_of(const fs::path& file) {
    constexpr std::size_t header_bytes = 48;
    const auto header = read_regular_file(file, header_bytes);
    char text[sum_digits + 1] = {};
    if (header)
        std::snprintf(text, sizeof text, "%016llx",
                      static_cast<unsigned long long>(XXH3_64bits(header->data(), header->size())));
    return text;
}

bool is_kept(const std::string& name) {
    return name.size() > key_digits + ending.size() && name[key_digits] == '-' && name.ends_with(ending) &&
           name.find_first_not_of("0123456789abcdef") == key_digits;
}

std::string source_of(const std::string& name) {
    const std::string rest = name.substr(key_digits + 1, name.size() - key_digits - 1 - ending.size());
    return rest.size() > sum_digits && rest[sum_digits] == '-' ? rest.substr(sum_digits + 1) : rest;
}

// The files' clock is not the system's in this version of the standard's library.
std::chrono::system_clock::time_point to_system(fs::file_time_type time) {
    const auto ago = fs::file_time_type::clock::now() - time;
    return std::chrono::system_clock::now() - std::chrono::duration_cast<std::chrono::system_clock::duration>(ago);
}

} // namespace

Result<std::uint64_t> parse_size(const std::string& text) {
    constexpr std::string_view units = "KMGT";
    std::uint64_t number = 0;
    const char* const end = text.data() + text.size();
    const auto [rest, error] = std::from_chars(text.data(), end, number);
    const std::string_view unit(rest, static_cast<std::size_t>(end - rest));
    const std::size_t place = unit.empty() ? 0 : units.find(unit) + 1; // of a word that is none: 0
    const bool is_unit = unit.empty() || (unit.size() == 1 && place > 0);
    const std::size_t shift = 10 * place;
    if (error != std::errc() || !is_unit || number == 0 || number > std::numeric_limits<std::uint64_t>::max() >> shift)
        return invalid_argument("'" + text + "' is no size: give bytes above 0, or a number with K, M, G or T.");
    return number << shift;
}

Result<void> TreeCache::check() const {
    std::error_code unknown;
    if (is_on() && fs::exists(folder_, unknown) && !fs::is_directory(folder_, unknown))
        return Error{ErrorCode::io_failure, "'" + folder_.string() +
                                                "' is no folder: no trees are kept. Set $UNSEEN_CACHE "
                                                "to the name of a folder."};
    const std::string size = variable("UNSEEN_CACHE_SIZE");
    if (size.empty() || parse_size(size)) return {};
    return Error{ErrorCode::invalid_argument, "$UNSEEN_CACHE_SIZE is passed over: " + parse_size(size).error().message};
}

// What the folder holds, as of the time of its last change.
struct TreeCache::Listing {
    std::mutex mutex;
    std::optional<fs::file_time_type> as_of;
    std::unordered_multimap<std::string, fs::path> files; // by key
    std::optional<std::uint64_t> bytes;                   // of all of them
};

TreeCache::TreeCache(const CacheOptions& options)
    : folder_(folder_of(options)), most_bytes_(most_bytes_of(options)), listing_(std::make_shared<Listing>()) {}

std::vector<fs::path> TreeCache::files_of(const std::string& key) const {
    if (!is_on()) return {};
    Listing& listing = *listing_;
    const std::lock_guard lock(listing.mutex);
    std::error_code failure;
    const fs::file_time_type changed = fs::last_write_time(folder_, failure);
    if (failure) return {};
    if (listing.as_of != changed) {
        listing.files.clear();
        listing.bytes.reset();
        for (fs::directory_iterator i(folder_, failure), end; !failure && i != end; i.increment(failure))
            if (const std::string name = i->path().filename().string(); is_kept(name))
                listing.files.emplace(name.substr(0, key_digits), i->path());
        listing.as_of = changed;
    }
    std::vector<fs::path> files;
    for (auto [i, end] = listing.files.equal_range(key); i != end; ++i) files.push_back(i->second);
    return files;
}

// That a file has come, and makes room for it.
void TreeCache::note(const std::string& key, const fs::path& file) const {
    Listing& listing = *listing_;
    const std::lock_guard lock(listing.mutex);
    std::error_code failure;
    listing.files.emplace(key, file);
    if (listing.bytes) *listing.bytes += fs::file_size(file, failure);
    else {
        listing.bytes = 0;
        for (const CachedTree& kept : trees()) *listing.bytes += kept.bytes;
    }
    listing.as_of = fs::last_write_time(folder_, failure);
    if (*listing.bytes <= most_bytes_) return;
    shrink(most_bytes_);
    listing.as_of.reset();
}

Result<std::optional<vdtree::VertexTree>> TreeCache::find(const std::string& key, const Progress& progress) const {
    for (const fs::path& file : files_of(key)) {
        std::error_code ignored;
        if (!fs::is_regular_file(file, ignored)) continue;
        if (file.filename().string().substr(key_digits + 1, sum_digits) != sum_of(file)) {
            fs::remove(file, ignored);
            continue;
        }
        auto tree = vdtree::read_tree(file, progress);
        if (tree) {
            fs::last_write_time(file, fs::file_time_type::clock::now(), ignored);
            return std::optional(std::move(*tree));
        }
        if (tree.error().code == ErrorCode::cancelled) return tree.error();
        fs::remove(file, ignored);
    }
    return std::optional<vdtree::VertexTree>();
}

Result<void> TreeCache::keep(const std::string& key, const fs::path& source, const vdtree::VertexTree& tree) const {
    std::error_code failure;
    if (fs::create_directories(folder_, failure)) // what somebody looks at is nobody else's business
        fs::permissions(folder_, fs::perms::owner_all, failure);
    if (failure)
        return Error{ErrorCode::io_failure, "Cannot make '" + folder_.string() + "': " + failure.message() + "."};
    if (tree.byte_size() > most_bytes_)
        return unsupported("The tree is larger than the " + grouped(most_bytes_) + " bytes that are kept.");
    const std::string name = source.filename().string().substr(0, longest_source) + std::string(ending);
    const fs::path file = folder_ / (key + "-" + name);
    if (const auto ready = vdtree::prepare_tree_file(file); !ready) return ready;
    if (const auto written = vdtree::write_tree(file, tree); !written) return written;
    const fs::path kept = folder_ / (key + "-" + sum_of(file) + "-" + name);
    fs::rename(file, kept, failure);
    if (failure)
        return Error{ErrorCode::io_failure, "Cannot rename '" + file.string() + "': " + failure.message() + "."};
    note(key, kept);
    return {};
}

std::vector<CachedTree> TreeCache::trees() const {
    std::vector<CachedTree> found;
    if (!is_on()) return found;
    std::error_code failure;
    for (fs::directory_iterator i(folder_, failure), end; !failure && i != end; i.increment(failure)) {
        const std::string name = i->path().filename().string();
        std::error_code gone; // by another process, meanwhile
        if (!is_kept(name) || !i->is_regular_file(gone)) continue;
        const std::uint64_t bytes = i->file_size(gone);
        if (gone) continue;
        const fs::file_time_type time = i->last_write_time(gone);
        if (!gone) found.push_back({i->path(), source_of(name), bytes, to_system(time)});
    }
    std::sort(found.begin(), found.end(), [](const CachedTree& a, const CachedTree& b) {
        return a.last_use != b.last_use ? a.last_use > b.last_use : a.file < b.file;
    });
    return found;
}

std::vector<CachedTree> TreeCache::shrink(std::uint64_t most_bytes) const {
    std::vector<CachedTree> removed;
    std::uint64_t bytes = 0;
    for (CachedTree& kept : trees()) {
        bytes += kept.bytes;
        std::error_code failure;
        if (bytes > most_bytes && fs::remove(kept.file, failure)) removed.push_back(std::move(kept));
    }
    return removed;
}

} // namespace unseen::session
