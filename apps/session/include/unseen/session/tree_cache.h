// Trees that were built and measured before, kept as files for the next time.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <unseen/vdtree/function_ref.h>
#include <unseen/vdtree/vertex_tree.h>

namespace unseen::session {

// Error messages and reasons call these fields load.cache.
struct CacheOptions {
    bool is_off = false;
    // Empty: $UNSEEN_CACHE ("off": no cache), else $XDG_CACHE_HOME/unseen, else $HOME/.cache/unseen, else no cache.
    std::filesystem::path folder = {};
    std::uint64_t most_bytes = 0; // 0: $UNSEEN_CACHE_SIZE where that is a size, else 4 GiB
};

// "500M": bytes, or with K, M, G or T those times 1024, 1024^2 and so on. Fails on what is none, and on 0.
Result<std::uint64_t> parse_size(const std::string& text);

// A tree that is kept.
struct CachedTree {
    std::filesystem::path file;
    std::string source; // the name of the file that it is of, without its folder
    std::uint64_t bytes = 0;
    std::chrono::system_clock::time_point last_use = {};
};

// A folder of tree files, each under the hash of all that its tree depends on. Several processes may use one folder:
// files appear whole, and one that is removed while it is read stays readable.
class TreeCache {
public:
    explicit TreeCache(const CacheOptions& options = {});

    bool is_on() const noexcept { return !folder_.empty(); }
    const std::filesystem::path& folder() const noexcept { return folder_; }
    std::uint64_t most_bytes() const noexcept { return most_bytes_; }

    // Fails if $UNSEEN_CACHE_SIZE is no size, or if the folder is a file.
    Result<void> check() const;

    // The tree under a key, read and checked to the last byte; it counts as used now. Nothing if there is none. A file
    // that is damaged, or whose tree was kept under another key, is removed. Fails only if `progress` cancels.
    Result<std::optional<vdtree::VertexTree>> find(const std::string& key, const Progress& progress = {}) const;

    // Keeps a tree, and removes those not used for longest where there are more than most_bytes(). Fails where the
    // folder cannot be made or written to, and on trees that are larger than that alone. `source`: the file that the
    // tree is of. Precondition: is_on().
    Result<void> keep(const std::string& key, const std::filesystem::path& source,
                      const vdtree::VertexTree& tree) const;

    // What is kept, the last used first.
    std::vector<CachedTree> trees() const;
    // Removes trees, those not used for longest first, until the rest takes so many bytes at most; 0: all. Returns
    // those that it has removed.
    std::vector<CachedTree> shrink(std::uint64_t most_bytes) const;

private:
    std::filesystem::path folder_; // empty: off
    std::uint64_t most_bytes_;
};

} // namespace unseen::session
