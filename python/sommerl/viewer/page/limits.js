/** What the page takes at most: apart from the readers, which the page's worker alone needs. */

export const LARGEST_FILE = 2 ** 27; // bytes: a MERL table of 360 bins takes 70 MB
