"""What is on disk, of whatever kind: written whole, sealed by checksums, listed, guarded, and compared.

file_list    Lists of the files of a folder with size and SHA-256, and comparison of the files with such a
             list.
folder_kind  Kinds of folders: what says that a folder is of one, and the sealed document in it.
hashes       SHA-256 of bytes, of files and of what JSON can say.
safe_files   Atomic writing of files and folders: whatever has its final name is complete.
sealed_json  JSON documents that end in a checksum of themselves, and JSON of strangers.
software     The software that a result follows from: versions, hashes of sources, and how those differ.
"""
