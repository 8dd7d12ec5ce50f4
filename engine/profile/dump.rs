//! A dispatch as a file: safetensors, a tensor of bytes before and, where the kernel writes, after it for each binding.

use crate::error::{Error, Result};
use crate::files::{read_file, write_atomic};
use crate::gpu::{Bound, Dispatch, Gpu, KernelInfo, kernel_named};
use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::collections::HashMap;
use std::io;
use std::path::Path;

#[derive(Serialize, Deserialize)]
struct Header {
    kernel: String,
    push: Vec<u8>,
    groups: [u32; 3],
    bindings: Vec<HeaderBinding>,
    device: String,
    /// SHA-256 of the bytes before and after, in order.
    digest: String,
}

#[derive(Serialize, Deserialize)]
struct HeaderBinding {
    name: String,
    same_as: Option<usize>,
    has_after: bool,
}

const KEY: &str = "dispatch";
const REMEDY: &str = "dump it again with `ivv profile ... --dump KERNEL`";

fn digest(dispatch: &Dispatch) -> String {
    let mut sha = Sha256::new();
    for bound in &dispatch.bindings {
        sha.update(&bound.before);
        sha.update(bound.after.as_deref().unwrap_or_default());
    }
    sha.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

fn tensor(index: usize, when: &str) -> String {
    format!("{index:02}.{when}")
}

pub fn write_dispatch(file: &Path, dispatch: &Dispatch, gpu: &Gpu) -> Result<()> {
    let binding = |b: &Bound| HeaderBinding { name: b.name.clone(), same_as: b.same_as, has_after: b.after.is_some() };
    let header = Header {
        kernel: dispatch.kernel.clone(),
        push: dispatch.push.clone(),
        groups: dispatch.groups,
        bindings: dispatch.bindings.iter().map(binding).collect(),
        device: format!("{}, {}", gpu.caps().name, gpu.caps().driver),
        digest: digest(dispatch),
    };
    write_atomic(file, |to| {
        let mut views = Vec::new();
        for (index, bound) in dispatch.bindings.iter().enumerate().filter(|(_, bound)| bound.same_as.is_none()) {
            let bytes = [("before", Some(&bound.before)), ("after", bound.after.as_ref())];
            for (when, bytes) in bytes.into_iter().filter_map(|(when, bytes)| Some((when, bytes?))) {
                let view = TensorView::new(Dtype::U8, vec![bytes.len()], bytes).map_err(io::Error::other)?;
                views.push((tensor(index, when), view));
            }
        }
        let metadata = HashMap::from([(KEY.to_owned(), serde_json::to_string(&header)?)]);
        to.write_all(&safetensors::serialize(views, Some(metadata)).map_err(io::Error::other)?)
    })
}

/// Reads a dispatch, whose kernel this engine has with the same bindings and push constants.
pub fn read_dispatch(file: &Path) -> Result<(Dispatch, &'static KernelInfo)> {
    let fault = |place: &str, reason: String| Error::data(file, place, reason, REMEDY);
    let bytes = read_file(file).map_err(|e| fault("", format!("cannot be read: {e}")))?;
    let (_, metadata) = SafeTensors::read_metadata(&bytes).map_err(|e| fault("header", e.to_string()))?;
    let tensors = SafeTensors::deserialize(&bytes).map_err(|e| fault("header", e.to_string()))?;
    let text = metadata.metadata().as_ref().and_then(|all| all.get(KEY));
    let text = text.ok_or_else(|| fault("header", "is no dumped dispatch".to_owned()))?;
    let header: Header = serde_json::from_str(text).map_err(|e| fault("header", e.to_string()))?;
    let kernel = kernel_named(&header.kernel)
        .ok_or_else(|| fault("header", format!("names the kernel `{}`, which there is not", header.kernel)))?;
    let names = header.bindings.iter().map(|binding| binding.name.as_str());
    if !names.eq(kernel.bindings.iter().map(|binding| binding.name)) || header.push.len() != kernel.push_bytes as usize
    {
        return Err(fault("header", format!("holds other bindings than those of `{}` today", kernel.name)));
    }
    if header.groups.iter().any(|n| *n > 65_535) {
        return Err(fault("header", format!("has a grid of {:?} workgroups", header.groups)));
    }
    let mut bindings = Vec::new();
    for (index, HeaderBinding { name, same_as, has_after }) in header.bindings.into_iter().enumerate() {
        let of = |when: &str| {
            let name = tensor(index, when);
            let view = tensors.tensor(&name).map_err(|e| fault(&format!("tensor `{name}`"), e.to_string()))?;
            Ok::<_, Error>(view.data().to_vec())
        };
        let bound = match same_as {
            Some(earlier) if earlier < index => Bound { name, same_as, before: Vec::new(), after: None },
            Some(earlier) => return Err(fault("header", format!("binding {index} is that of binding {earlier}"))),
            None => {
                let (before, after) = (of("before")?, if has_after { Some(of("after")?) } else { None });
                if before.is_empty() || after.as_ref().is_some_and(|after| after.len() != before.len()) {
                    return Err(fault(&format!("binding `{name}`"), "has other bytes after than before".to_owned()));
                }
                Bound { name, same_as, before, after }
            }
        };
        bindings.push(bound);
    }
    let dispatch = Dispatch { kernel: header.kernel, push: header.push, groups: header.groups, bindings };
    if digest(&dispatch) != header.digest {
        return Err(fault("", "holds other bytes than were written".to_owned()));
    }
    Ok((dispatch, kernel))
}
