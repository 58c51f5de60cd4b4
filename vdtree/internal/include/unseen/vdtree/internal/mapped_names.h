// What became of the files that are mapped, for handlers of signals: nothing here locks or allocates.
#pragma once

namespace unseen::vdtree {

// The name of the file that is mapped at the address, as it was opened. Null if there is none, or if more than 32 files
// are mapped.
const char* mapped_file_at(const void* address) noexcept;

// The name of a mapped file that was written to since it was mapped; null if there is none.
const char* changed_mapped_file() noexcept;

} // namespace unseen::vdtree
